"""What every room may use: errors, files, progress, signals, worker processes, plain YAML. Imports no other room."""
