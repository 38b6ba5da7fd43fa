"""Looks at a stream as an integrator would: what would keep the tracker from working, and how to fix it."""
