"""MCAP recordings: read as far as they go, written whole or not at all, repaired, copied."""
