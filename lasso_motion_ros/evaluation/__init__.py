"""Tracking against truth: measures per pair, their summary, the published model experiment."""
