"""Projection, rigid transforms, curves, ellipses, and the biplane frames that carry them."""
