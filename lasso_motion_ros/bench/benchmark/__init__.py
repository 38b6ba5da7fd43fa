"""A benchmark that others can enter: recordings and truth of the clinic suite as files, and the score of any result."""
