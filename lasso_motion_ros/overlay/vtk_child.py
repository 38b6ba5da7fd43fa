"""Reads a VTK surface file in a process of its own: VTK trusts what a file says of itself, and ends where it lies.

Run by `vtk_bridge.read_polygons`; writes what it has read as a NumPy archive.
"""

from __future__ import annotations

import resource
import sys
from pathlib import Path

import numpy as np

from lasso_motion_ros.core.errors import SurfaceError
from lasso_motion_ros.overlay.vtk_bridge import CHILD_SAID, parse_polygons

MEMORY_BYTES = 6 << 30
"""Address space: a file of the size that is read at most, as text and unpacked, and the libraries."""


def main(path: Path, output: Path) -> int:
    """Read `path` into `output`; returns the exit status."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    try:
        vertices, triangles, space = parse_polygons(path)
    except SurfaceError as error:
        sys.stderr.write(f"{error}\n")
        return CHILD_SAID
    np.savez(output, vertices=vertices, triangles=triangles, space=np.array(space))
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2])))
