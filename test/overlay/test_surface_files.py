"""Readers of surfaces: every format and byte order, and a clear refusal for what is none."""

import struct
import sys

import numpy as np
import pytest
from support.rendering_inputs import ellipsoid_mesh, is_closed

from lasso_motion_ros.core.errors import SurfaceError
from lasso_motion_ros.overlay import surface_files as surface_module
from lasso_motion_ros.overlay.surface_files import SUFFIXES, read_surface, write_stl
from lasso_motion_ros.overlay.triangle_mesh import clean_mesh

pytest.importorskip("trimesh", reason="pip install 'lasso_motion_ros[overlay]'")

CORNERS = np.array([[0, 0, 0], [10, 0, 0], [0, 20, 0], [0, 0, 30]], dtype=float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
PLY_HEADER = (
    "ply\nformat {} 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\nproperty float y\n"
    "property float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n"
)


def text_stl():
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x} {y} {z}\n" for x, y, z in CORNERS[face])
        + "endloop\nendfacet\n"
        for face in FACES
    )
    return f"solid tetrahedron\n{facets}endsolid\n".encode()


def binary_stl(header=b"made by hand"):
    records = b"".join(struct.pack("<12fH", 0, 0, 0, *CORNERS[face].ravel(), 0) for face in FACES)
    return header.ljust(80) + struct.pack("<I", len(FACES)) + records


def text_ply():
    body = "".join(f"{x} {y} {z}\n" for x, y, z in CORNERS) + "".join(f"3 {a} {b} {c}\n" for a, b, c in FACES)
    return (PLY_HEADER.format("ascii") + body).encode()


def binary_ply(order, name):
    faces = b"".join(struct.pack(f"{order}B3i", 3, *face) for face in FACES)
    return PLY_HEADER.format(f"binary_{name}_endian").encode() + CORNERS.astype(f"{order}f4").tobytes() + faces


def obj(face_lines):
    return ("".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS) + face_lines).encode()


OBJ_FACES = "".join("f {} {} {}\n".format(*(face + 1)) for face in FACES)
GOOD = {
    "text.stl": text_stl(),
    "binary.stl": binary_stl(),
    "binary_begins_with_solid.STL": binary_stl(b"solid but binary"),
    "text.ply": text_ply(),
    "crlf.ply": text_ply().replace(b"\n", b"\r\n"),
    "little.ply": binary_ply("<", "little"),
    "big.ply": binary_ply(">", "big"),
    "plain.obj": obj(OBJ_FACES),
    "with_normals_and_textures.obj": obj(
        "vt 0 0\nvn 0 0 1\n" + "".join("f {}/1/1 {}/1/1 {}/1/1\n".format(*(face + 1)) for face in FACES)
    ),
    "negative_indices.obj": obj("".join("f {} {} {}\n".format(*(face - 4)) for face in FACES)),
    "in_parts_with_material.obj": b"mtllib /etc/hostname\n"
    + obj("o one\nusemtl a\n" + OBJ_FACES[:16] + "o two\nusemtl b\n" + OBJ_FACES[16:]),
}


@pytest.mark.parametrize("name", GOOD)
def test_every_format_gives_the_same_tetrahedron(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(GOOD[name])
    mesh = read_surface(path, "mm")
    assert mesh.vertices.shape == (4, 3)
    assert mesh.triangles.shape == (4, 3)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [0.010, 0.020, 0.030])
    assert is_closed(mesh)
    # Signed volume a · (b × c) / 6 summed: 10 · 20 · 30 / 6 mm³, positive as the normals point outwards.
    a, b, c = (mesh.vertices[mesh.triangles[:, i]] for i in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0 == pytest.approx(1e-6)


def test_units_are_those_of_the_file(tmp_path):
    path = tmp_path / "a.stl"
    path.write_bytes(binary_stl())
    np.testing.assert_allclose(read_surface(path, "m").vertices, 1e3 * read_surface(path, "mm").vertices)


def test_polygons_are_split_into_triangles(tmp_path):
    path = tmp_path / "quad.obj"
    path.write_bytes(obj("v 10 20 0\nf 1 2 5 3\n"))
    mesh = read_surface(path, "mm")
    assert len(mesh.triangles) == 2
    assert mesh.areas.sum() == pytest.approx(10e-3 * 20e-3)


BAD = {
    "cut.stl": (binary_stl()[:-60], "cut short: 224 of 284 bytes"),
    "empty.stl": (b"", "0 bytes"),
    "no_triangle.stl": (binary_stl()[:80] + bytes(4), "no triangle"),
    "too_many.stl": (binary_stl()[:80] + b"\xff\xff\xff\xff", "4294967295 triangles, at most 2000000"),
    "too_many.ply": (text_ply().replace(b"element face 4", b"element face 99999999"), "99999999 triangles"),
    "points_without_end.ply": (text_ply().replace(b"vertex 4", b"vertex 999999999999"), "at most 2000000"),
    "cut.ply": (binary_ply("<", "little")[:-20], "not a readable PLY"),
    "words.ply": (b"hello", "not a readable PLY"),
    "points_only.ply": (text_ply().split(b"element face")[0] + b"end_header\n" + b"0 0 0\n" * 4, "no triangle"),
    "range.obj": (obj("f 1 2 9\n"), "not a readable OBJ"),
    "not_finite.obj": (obj(OBJ_FACES).replace(b"v 10.0 0.0", b"v nan 0.0"), "not finite"),
    "flat.obj": (obj("f 1 1 2\n"), "degenerate"),
    "points.obj": (obj(""), "no triangle"),
    "heart.stp": (b"", "expected a surface as .stl, .ply, .obj, .vtk, .vtp, found .stp"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_by_name_and_reason(tmp_path, name):
    data, reason = BAD[name]
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(SurfaceError) as caught:
        read_surface(path, "mm")
    assert str(path) in str(caught.value)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_unit_must_be_given_and_the_file_be_there(tmp_path):
    with pytest.raises(SurfaceError, match="must be given as mm or m, found ''"):
        read_surface(tmp_path / "a.stl", "")
    with pytest.raises(SurfaceError, match="No such file"):
        read_surface(tmp_path / "a.stl", "mm")


def test_a_huge_file_is_not_even_read(tmp_path, monkeypatch):
    monkeypatch.setattr(surface_module, "MAX_FILE_BYTES", 100)
    path = tmp_path / "a.stl"
    path.write_bytes(binary_stl())
    with pytest.raises(SurfaceError, match="at most"):
        read_surface(path, "mm")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_has_no_size_and_no_end_is_read_no_further_than_a_file_may_be_long(suffix, tmp_path, monkeypatch):
    """Before, it took all of the machine's memory."""
    monkeypatch.setattr(surface_module, "MAX_FILE_BYTES", 100_000)
    path = tmp_path / f"a{suffix}"
    path.symlink_to("/dev/zero")
    with pytest.raises(SurfaceError, match=r"cannot be read: it has more than 100000 bytes$"):
        read_surface(path, "mm")


@pytest.mark.parametrize("units", ["mm", "m"])
def test_what_is_written_is_read_back(tmp_path, units):
    mesh = clean_mesh(1e-3 * CORNERS, FACES)
    write_stl(tmp_path / "a.stl", mesh, units)
    back = read_surface(tmp_path / "a.stl", units)
    np.testing.assert_allclose(back.vertices, mesh.vertices, rtol=1e-6)
    np.testing.assert_array_equal(back.triangles, mesh.triangles)


LEGACY_VTK = """# vtk DataFile Version 3.0
3D Slicer output. SPACE={space}
ASCII
DATASET POLYDATA
POINTS 5 float
0 0 0  10 0 0  10 10 0  0 10 0  5 5 10
POLYGONS 5 21
4 3 2 1 0
3 0 1 4
3 1 2 4
3 2 3 4
3 3 0 4
"""
VTP = """<?xml version="1.0"?>
<VTKFile type="PolyData" version="0.1" byte_order="LittleEndian"><PolyData>
<Piece NumberOfPoints="5" NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="5">
<Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">
0 0 0  10 0 0  10 10 0  0 10 0  5 5 10</DataArray></Points>
<Polys><DataArray type="Int64" Name="connectivity" format="ascii">3 2 1 0 0 1 4 1 2 4 2 3 4 3 0 4</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">4 7 10 13 16</DataArray></Polys>
</Piece></PolyData></VTKFile>
"""


@pytest.mark.parametrize("suffix", [".vtk", ".vtp"])
def test_vtk_files_give_their_pyramid(tmp_path, suffix):
    """A pyramid of base 10 × 10 and height 10 mm: volume a third of the product; the square becomes two triangles."""
    pytest.importorskip("vtkmodules")
    path = tmp_path / f"pyramid{suffix}"
    path.write_text(LEGACY_VTK.format(space="LPS") if suffix == ".vtk" else VTP)
    mesh = read_surface(path, "mm")
    assert (len(mesh.vertices), len(mesh.triangles)) == (5, 6)
    corners = mesh.vertices[mesh.triangles]
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    assert abs(volume) == pytest.approx(1e-6 / 3.0, rel=1e-5)


@pytest.mark.parametrize(
    ("space", "axes", "sign"), [("LPS", "", 1), ("RAS", "", -1), ("RAS", "lps", 1), ("LPS", "ras", -1)]
)
def test_axes_are_the_files_unless_they_are_given(tmp_path, space, axes, sign):
    pytest.importorskip("vtkmodules")
    path = tmp_path / "pyramid.vtk"
    path.write_text(LEGACY_VTK.format(space=space))
    top = max(read_surface(path, "mm", axes).vertices, key=lambda vertex: vertex[2])
    np.testing.assert_allclose(top, [sign * 5e-3, sign * 5e-3, 10e-3])


def test_an_stl_that_says_ras_is_turned(tmp_path):
    mesh = ellipsoid_mesh((0.01, 0.02, 0.03), (0.1, 0.2, 0.3), rows=12, columns=7)
    path = tmp_path / "ras.stl"
    write_stl(path, mesh, "mm")
    np.testing.assert_allclose(read_surface(path, "mm").vertices.mean(axis=0), [0.1, 0.2, 0.3], atol=2e-3)
    path.write_bytes(path.read_bytes().replace(b"SPACE=LPS", b"SPACE=RAS"))
    np.testing.assert_allclose(read_surface(path, "mm").vertices.mean(axis=0), [-0.1, -0.2, 0.3], atol=2e-3)
    with pytest.raises(SurfaceError, match="axes are lps or ras"):
        read_surface(path, "mm", "xyz")


def test_without_vtk_it_is_said_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "vtkmodules.vtkCommonCore", None)
    path = tmp_path / "pyramid.vtk"
    path.write_text(LEGACY_VTK.format(space="LPS"))
    with pytest.raises(SurfaceError, match=r"lasso_motion_ros\[volume\]"):
        read_surface(path, "mm")


def test_a_vtk_file_that_is_none_is_refused(tmp_path):
    pytest.importorskip("vtkmodules")
    for name, text in (("heart.vtk", "no surface"), ("heart.vtp", "<VTKFile"), ("empty.vtk", "")):
        (tmp_path / name).write_text(text)
        with pytest.raises(SurfaceError, match=f"{name}: (not a readable|the surface has no triangle)"):
            read_surface(tmp_path / name, "mm")


@pytest.mark.parametrize(
    ("end", "said"),
    [
        ("echo 'OSError: No space left on device' >&2; exit 1", "failed: OSError: No space left on device"),
        ("kill -KILL $$", "ended by SIGKILL: is there enough memory"),
        ("kill -SEGV $$", "its counts or indices are wrong: VTK ended with SIGSEGV"),
    ],
)
def test_a_file_is_not_blamed_for_how_its_process_ended(tmp_path, monkeypatch, end, said):
    pytest.importorskip("vtkmodules")
    python = tmp_path / "python"
    python.write_text(f"#!/bin/sh\n{end}\n")
    python.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(python))
    path = tmp_path / "pyramid.vtk"
    path.write_text(LEGACY_VTK.format(space="LPS"))
    with pytest.raises(SurfaceError, match=said):
        read_surface(path, "mm")


CRAFTED = """# vtk DataFile Version 3.0
crafted
ASCII
DATASET POLYDATA
POINTS 3 float
0 0 0 1 0 0 0 1 0
{polygons}
"""


@pytest.mark.parametrize(
    ("polygons", "said"),
    [
        ("POLYGONS 1 4\n3 0 1 900000000", "its counts or indices are wrong|names a vertex beyond the 3"),
        ("POLYGONS 1 4\n3 0 1 -900000000", "its counts or indices are wrong|names a vertex beyond the 3"),
        ("POLYGONS 1 4\n900000000 0 1 2", "crafted.vtk: "),
        ("TRIANGLE_STRIPS 1 5\n4 0 1 2 900000000", "crafted.vtk: "),
    ],
)
def test_a_vtk_file_that_lies_is_one_error_and_not_the_end_of_the_process(tmp_path, polygons, said):
    """Counts and indices beyond what is there: VTK itself reads, or writes, beyond its arrays."""
    pytest.importorskip("vtkmodules")
    path = tmp_path / "crafted.vtk"
    path.write_text(CRAFTED.format(polygons=polygons))
    with pytest.raises(SurfaceError, match=said):
        read_surface(path, "mm")
