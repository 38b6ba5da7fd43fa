"""The compiled kernels of our method: see `core/compiled.py`."""
