"""What every room may use: errors, files, progress, signals, worker processes, plain YAML, log odds.

It imports no other room.
"""
