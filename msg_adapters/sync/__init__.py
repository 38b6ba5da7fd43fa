"""Which messages belong together: images with their calibrations, plane A with plane B."""
