"""What people look at: overlays, tracking pictures, plots, videos."""
