"""What VTK does for us (in the optional extra `volume`): its surface files, iso-surfaces, decimation.

Imported only when needed: the library is large.
"""

from __future__ import annotations

import importlib
import importlib.util
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import SurfaceError

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

NO_VTK = "VTK files and surfaces of volumes need VTK: pip install 'lasso_motion_ros[volume]'"
WAIT_S = 120.0
"""How long VTK may take for a file of the size that is read at most."""
CRASHES = (signal.SIGSEGV, signal.SIGABRT, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGTRAP)
"""How a process ends that has believed a file that lies."""
CHILD_SAID = 2
"""Exit status with which the child says in words what is wrong."""


def read_polygons(path: Path) -> tuple[Array, Indices, str]:
    """Vertices (V, 3) and triangles (T, 3) of a legacy VTK or a VTP file, and the axes it states ("" if none).

    A child process reads it: VTK believes the counts and indices in a file, and a file that lies ends the process.

    Raises:
        SurfaceError: VTK is not installed, or the file is no surface.
    """
    if importlib.util.find_spec("vtkmodules") is None or importlib.util.find_spec("vtkmodules.vtkCommonCore") is None:
        raise SurfaceError(NO_VTK)
    with tempfile.TemporaryDirectory(prefix="lasso_motion_") as directory:
        output = Path(directory) / "surface.npz"
        command = [sys.executable, "-m", "lasso_motion_ros.overlay.vtk_child", str(path), str(output)]
        try:
            done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False, timeout=WAIT_S)
        except subprocess.TimeoutExpired as error:
            raise SurfaceError(f"VTK has not read it within {WAIT_S:g} s") from error
        if done.returncode == CHILD_SAID:
            raise SurfaceError(done.stderr.decode("utf-8", "replace").strip().splitlines()[-1])
        if done.returncode != 0:
            raise SurfaceError(_how_it_ended(done.returncode, done.stderr.decode("utf-8", "replace")))
        with np.load(output, allow_pickle=False) as read:
            vertices, triangles = np.asarray(read["vertices"], np.float64), np.asarray(read["triangles"], np.int64)
            space = str(read["space"])
    if triangles.min(initial=0) < 0 or triangles.max(initial=0) >= len(vertices):
        raise SurfaceError(f"a triangle names a vertex beyond the {len(vertices)} that there are")
    return vertices, triangles, space


def _how_it_ended(status: int, said: str) -> str:
    """Why a child has not read the file: because the file lies, or because of something else."""
    if -status in CRASHES:
        return f"its counts or indices are wrong: VTK ended with {signal.Signals(-status).name} while it read the file"
    if status < 0:
        return f"the process in which VTK read it was ended by {signal.Signals(-status).name}: is there enough memory?"
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    return f"the process in which VTK read it failed: {lines[-1] if lines else f'status {status}'}"


def parse_polygons(path: Path) -> tuple[Array, Indices, str]:
    """As `read_polygons`, in this process: a file that lies may end it.

    Raises:
        SurfaceError: VTK is not installed, or the file is no surface.
    """
    core = _vtk("CommonCore")
    core.vtkObject.GlobalWarningDisplayOff()  # our own error says it
    if path.suffix.lower() == ".vtp":
        reader = _vtk("IOXML").vtkXMLPolyDataReader()
    else:
        reader = _vtk("IOLegacy").vtkGenericDataObjectReader()
    reader.SetFileName(str(path))
    reader.Update()
    data = reader.GetOutputDataObject(0)
    if data is None or reader.GetErrorCode():
        raise SurfaceError(f"not a readable {path.suffix[1:].upper()} surface")
    if data.IsA("vtkUnstructuredGrid"):
        outside = _vtk("FiltersGeometry").vtkGeometryFilter()
        outside.SetInputData(data)
        outside.Update()
        data = outside.GetOutput()
    if not data.IsA("vtkPolyData"):
        raise SurfaceError(f"the file holds {data.GetClassName()}, expected polygons (vtkPolyData)")
    stated = data.GetFieldData().GetAbstractArray("SPACE")
    space = str(stated.GetValue(0)) if stated is not None and stated.GetNumberOfTuples() else ""
    vertices, triangles = _triangles(data)
    return vertices, triangles, space


def level_surface(values: npt.NDArray[Any], level: float, spacing: Array, most: int) -> tuple[Array, Indices]:
    """The surface on which values cross a level (flying edges).

    Args:
        values: (Z, Y, X) samples.
        level: the value on the surface.
        spacing: (3,) distance between samples along x, y, z, in any unit.
        most: largest number of triangles; more are reduced by quadric edge collapse.

    Returns:
        (V, 3) vertices as *indices* (x, y, z) into the samples, and (T, 3) triangles.

    Raises:
        SurfaceError: VTK is not installed, or the values do not cross the level.
    """
    edges = _vtk("FiltersCore").vtkFlyingEdges3D()
    edges.SetInputData(_image(values, spacing))
    edges.SetValue(0, level)
    edges.ComputeNormalsOff()
    edges.ComputeScalarsOff()
    return _reduced(edges, spacing, most)


def label_surface(values: npt.NDArray[Any], label: int, spacing: Array, most: int) -> tuple[Array, Indices]:
    """The boundary of one label (surface nets: smooth, and within a voxel of the voxels' own); as `level_surface`."""
    nets = _vtk("FiltersCore").vtkSurfaceNets3D()
    nets.SetInputData(_image((values == label).astype(np.uint8), spacing))
    nets.SetValue(0, 1)
    return _reduced(nets, spacing, most)


def _image(values: npt.NDArray[Any], spacing: Array) -> Any:
    image = _vtk("CommonDataModel").vtkImageData()
    image.SetDimensions(*values.shape[::-1])
    image.SetSpacing(*spacing)
    flat = np.ascontiguousarray(values).ravel()
    if flat.dtype == np.bool_:
        flat = flat.astype(np.uint8)
    support = _vtk("util.numpy_support")
    image.GetPointData().SetScalars(support.numpy_to_vtk(flat, deep=True))
    return image


def _reduced(source: Any, spacing: Array, most: int) -> tuple[Array, Indices]:
    source.Update()
    surface = _triangulated(source.GetOutput())
    count = surface.GetNumberOfPolys()
    if count == 0:
        raise SurfaceError("there is no surface at this level or label")
    if count > most:
        fewer = _vtk("FiltersCore").vtkQuadricDecimation()
        fewer.SetInputData(surface)
        fewer.SetTargetReduction(1.0 - most / count)
        fewer.VolumePreservationOn()
        fewer.Update()
        surface = fewer.GetOutput()
    vertices, triangles = _triangles(surface)
    return vertices / spacing, triangles


def _triangulated(data: Any) -> Any:
    triangulated = _vtk("FiltersCore").vtkTriangleFilter()
    triangulated.SetInputData(data)
    triangulated.PassLinesOff()
    triangulated.PassVertsOff()
    triangulated.Update()
    return triangulated.GetOutput()


def _triangles(data: Any) -> tuple[Array, Indices]:
    surface = _triangulated(data)
    if surface.GetNumberOfPolys() == 0:
        raise SurfaceError("the surface has no triangle")
    to_numpy = _vtk("util.numpy_support").vtk_to_numpy
    vertices = np.array(to_numpy(surface.GetPoints().GetData()), dtype=np.float64)
    triangles = np.array(to_numpy(surface.GetPolys().GetConnectivityArray()), dtype=np.int64)
    return vertices, triangles.reshape(-1, 3)


def _vtk(module: str) -> Any:
    try:
        return importlib.import_module(f"vtkmodules.{module if '.' in module else 'vtk' + module}")
    except ImportError as error:
        raise SurfaceError(NO_VTK) from error
