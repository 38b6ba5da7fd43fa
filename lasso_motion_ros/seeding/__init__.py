"""From clicks to a 3-D ellipse, where both methods start: line filter, minimal path, outlines, reconstruction."""
