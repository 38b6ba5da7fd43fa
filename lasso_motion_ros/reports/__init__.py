"""Pages, figures, pictures and videos of results."""
