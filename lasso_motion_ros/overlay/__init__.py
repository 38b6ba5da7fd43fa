"""What is drawn over the film: the volume's surface or projection, at the static and at the compensated place."""
