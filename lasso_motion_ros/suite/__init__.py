"""The phantom suite: random short sequences, run in memory and counted; sweeps of one property at a time."""
