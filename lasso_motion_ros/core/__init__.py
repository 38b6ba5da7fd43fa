"""What every room may use: errors, the package's own files, progress, plain YAML. Imports no other room."""
