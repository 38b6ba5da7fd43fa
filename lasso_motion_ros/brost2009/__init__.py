"""The published method in the paper's order: features, registration, tracker (Brost et al., MICCAI 2009)."""
