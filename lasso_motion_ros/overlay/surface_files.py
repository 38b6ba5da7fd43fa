"""Surfaces as files: reading STL, PLY, OBJ, VTK and VTP, writing STL.

trimesh and VTK do the reading (optional dependencies: the method does without them). Added here is what a clinical
tool needs: bounds, errors that name the file, units and axes, and vertices shared between triangles, without which a
surface has no silhouette.
"""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.bounded_files import read_bounded
from lasso_motion_ros.core.errors import SurfaceError
from lasso_motion_ros.overlay.triangle_mesh import MAX_TRIANGLES, TriangleMesh, clean_mesh

Array = npt.NDArray[np.float64]
Units = Literal["mm", "m"]

MAX_FILE_BYTES = 512 * 1024 * 1024
TRIMESH_SUFFIXES, VTK_SUFFIXES = (".stl", ".ply", ".obj"), (".vtk", ".vtp")
SUFFIXES = TRIMESH_SUFFIXES + VTK_SUFFIXES
METRES_PER_UNIT: dict[str, float] = {"mm": 1e-3, "m": 1.0}
AXES = ("lps", "ras")
_RAS_TO_LPS = np.array([-1.0, -1.0, 1.0])


def read_surface(path: str | Path, units: str, axes: str = "") -> TriangleMesh:
    """Read an STL (text or binary), PLY (text, binary of either endianness), OBJ, legacy VTK or VTP file.

    Args:
        path: the file; its suffix tells the format.
        units: "mm" or "m", the unit of the file's coordinates (none of the formats states it).
        axes: "lps" or "ras", what the file's x, y and z mean; empty: as the file states ("SPACE=RAS" in its
            header, as 3D Slicer writes it), and LPS where it says nothing.

    Returns:
        The surface in metres and LPS; polygons are split into triangles, parts are joined.

    Raises:
        SurfaceError: naming file and reason: unreadable, unknown format, unit not given, too large, empty.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise SurfaceError(f"{path}: expected a surface as {', '.join(SUFFIXES)}, found {suffix or 'no suffix'}")
    if units not in METRES_PER_UNIT:
        raise SurfaceError(f"{path}: the unit of its coordinates must be given as mm or m, found {units!r}")
    try:
        size = path.stat().st_size
        if size > MAX_FILE_BYTES:
            raise SurfaceError(f"{path}: {size / 2**20:.0f} MiB, at most {MAX_FILE_BYTES // 2**20} MiB are read")
        data = read_bounded(path, MAX_FILE_BYTES)
    except OSError as error:
        raise SurfaceError(f"{path}: cannot be read: {error.strerror}") from error
    announced = 0 if suffix in VTK_SUFFIXES else _announced_triangles(data, suffix)
    if announced > MAX_TRIANGLES:
        raise SurfaceError(f"{path}: {announced} triangles, at most {MAX_TRIANGLES} are drawn: decimate the surface")
    try:
        if suffix == ".stl":
            _refuse_short_stl(data)
        stated = _stated_axes(data)
        vertices: Array
        triangles: npt.NDArray[np.integer]
        if suffix in VTK_SUFFIXES:
            from lasso_motion_ros.overlay.vtk_bridge import read_polygons

            vertices, triangles, space = read_polygons(path)
            stated = space.lower() or stated
        else:
            vertices, triangles = _load(data, suffix)
        axes = axes or stated or "lps"
        if axes not in AXES:
            raise SurfaceError(f"axes are lps or ras, found {axes!r}")
        scale = METRES_PER_UNIT[units] * (_RAS_TO_LPS if axes == "ras" else np.ones(3))
        return clean_mesh(vertices * scale, triangles)
    except SurfaceError as error:
        raise SurfaceError(f"{path}: {error}") from error


def write_stl(path: str | Path, mesh: TriangleMesh, units: Units) -> None:
    """Write a binary STL in the given unit and in LPS, overwriting.

    Raises:
        SurfaceError: the file cannot be written.
    """
    record = np.zeros(
        len(mesh.triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
    )
    corners = mesh.vertices[mesh.triangles] / METRES_PER_UNIT[units]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    record["normal"] = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    record["corners"] = corners
    header = f"lasso_motion_ros surface, SPACE=LPS, coordinates in {units}".encode("ascii").ljust(80)
    try:
        Path(path).write_bytes(header + np.uint32(len(record)).astype("<u4").tobytes() + record.tobytes())
    except OSError as error:
        raise SurfaceError(f"{path}: cannot be written: {error.strerror}") from error


def _stated_axes(data: bytes) -> str:
    """The axes, lps or ras, where the head of a file says so, else empty."""
    found = re.search(rb"SPACE=(LPS|RAS)", data[:2048])
    return "" if found is None else found[1].decode().lower()


def _announced_triangles(data: bytes, suffix: str) -> int:
    """How many triangles the file says it has, before anything is allocated for them."""
    if suffix == ".ply":
        counts = dict(re.findall(rb"^element\s+(vertex|face)\s+(\d+)", data[:65536], flags=re.MULTILINE))
        # Even triangles that share no vertex have three each; a surface has no more vertices than that.
        return max(int(counts.get(b"face", 0)), int(counts.get(b"vertex", 0)) // 3)
    if suffix == ".obj":
        return len(re.findall(rb"^f\s", data, flags=re.MULTILINE))
    if _is_text_stl(data):
        return data.count(b"endfacet")
    return int.from_bytes(data[80:84], "little")


def _is_text_stl(data: bytes) -> bool:
    # Some exporters begin a binary file with "solid" too, so that word alone does not decide.
    return data.lstrip()[:5] == b"solid" and b"\0" not in data[:4096] and b"facet" in data[:4096]


def _refuse_short_stl(data: bytes) -> None:
    if _is_text_stl(data):
        return
    if len(data) < 84:
        raise SurfaceError(f"not an STL surface: {len(data)} bytes, neither text nor a binary header")
    expected = 84 + 50 * int.from_bytes(data[80:84], "little")
    if len(data) < expected:
        raise SurfaceError(f"not an STL surface, or cut short: {len(data)} of {expected} bytes")


def _load(data: bytes, suffix: str) -> tuple[Array, npt.NDArray[np.integer]]:
    try:
        import trimesh
    except ImportError as error:
        raise SurfaceError("reading surfaces needs trimesh: pip install 'lasso_motion_ros[overlay]'") from error
    try:
        # Read from memory, so that no material or texture file beside it is opened.
        file_type = "stl_ascii" if suffix == ".stl" and _is_text_stl(data) else suffix[1:]
        mesh = trimesh.load_mesh(io.BytesIO(data), file_type=file_type, process=False)
        vertices = np.asarray(mesh.vertices, dtype=np.float64)
        triangles = np.asarray(mesh.faces, dtype=np.int64)
    except Exception as error:  # a parser may raise anything on a foreign file
        raise SurfaceError(f"not a readable {suffix[1:].upper()} surface: {error or type(error).__name__}") from error
    if triangles.size == 0:
        raise SurfaceError("the surface has no triangle")
    return vertices, triangles
