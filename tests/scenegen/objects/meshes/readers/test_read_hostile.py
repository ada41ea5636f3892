"""Mesh files that are too large, damaged or no files at all are refused, with bounded effort."""

import os

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from known_meshes import CORNERS, OBJ, SPHERE

from scenegen.objects.meshes import limits
from scenegen.objects.meshes.clean import clean_mesh
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.read import parse_mesh, read_bytes


def refusal(data, suffix):
    with pytest.raises(BadMeshError) as refused:
        parse_mesh(data, suffix)
    return refused.value


def test_faces_that_would_take_hours_are_refused():
    rng = np.random.default_rng(0)
    lines = [f"v {x} {y} 0" for x, y in rng.random((150_000, 2))]
    lines.append("f " + " ".join(map(str, range(1, 150_001))))
    assert "150000 corners" in refusal("\n".join(lines).encode(), ".obj").found


@pytest.mark.parametrize(
    ("more", "limit", "where"),
    [
        (b"f 1 2 3\n" * 15, "MOST_FACES", "faces"),
        (b"f 1 2 3\n" * 25, "MOST_CORNERS", "corners of faces"),
        (b"v 1 2 3\n" * 60, "MOST_CORNERS", "vertices"),
    ],
)
def test_limits_hold(more, limit, where, monkeypatch):
    parse_mesh(CORNERS.encode() + more + b"f 1 2 3\n", ".obj")
    monkeypatch.setattr(limits, limit, 10)
    error = refusal(CORNERS.encode() + more, ".obj")
    assert (error.where, error.expected) == (where, "at most 10")


@pytest.mark.parametrize(
    ("data", "suffix", "found"),
    [
        (b"ply\nformat binary_little_endian 1.0\nelement vertex 900000000000\nproperty float x\n"
         b"end_header\n", ".ply", "more rows than"),
        (b"OFF\n900000000000 900000000000 0\n1 2 3\n", ".off", "fewer numbers"),
        (bytes(80) + b"\xff\xff\xff\xff", ".stl", "0 triangles"),
        (b"short", ".stl", "5 bytes"),
        (b"\x89PNG\r\n\x1a\n" + bytes(99), ".glb", "does not begin with glTF"),
        (b"OBJ", ".off", "a first line other"),
        (b"OFF\nx y\n", ".off", "no counts"),
        (b"x", ".fbx", "'.fbx'"),
    ],
)  # fmt: skip
def test_small_files_that_claim_to_be_large_or_are_something_else(data, suffix, found):
    assert found in refusal(data, suffix).found


def test_files_that_are_no_files(tmp_path, monkeypatch):
    names = {
        "nothing in it": "empty blank",
        "a folder or a device": "folder pipe",
        "no such file": "none loop gone",
        "more bytes": "big",
    }
    (tmp_path / "empty.obj").touch()
    (tmp_path / "blank.obj").write_bytes(b" \r\n\0\0\n" * 8)
    (tmp_path / "folder.obj").mkdir()
    (tmp_path / "loop.obj").symlink_to(tmp_path / "loop.obj")
    (tmp_path / "gone.obj").symlink_to(tmp_path / "nothing")
    os.mkfifo(tmp_path / "pipe.obj")  # reading it would never end
    (tmp_path / "big.obj").write_text(OBJ["plain"])
    monkeypatch.setattr(limits, "MOST_BYTES", 50)
    for found, name in ((found, name) for found, some in names.items() for name in some.split()):
        with pytest.raises(BadMeshError) as refused:
            read_bytes(tmp_path / f"{name}.obj")
        assert (refused.value.where, refused.value.found) == ("file", found), name


BOX = trimesh.creation.box()
SEEDS = [
    (OBJ["textured"].encode(), ".obj"),
    (SPHERE.export(file_type="ply")[:4000], ".ply"),
    (BOX.export(file_type="ply", encoding="ascii"), ".ply"),
    (BOX.export(file_type="stl_ascii").encode(), ".stl"),
    (BOX.export(file_type="off").encode(), ".off"),
    *((BOX.export(file_type=kind), f".{kind}") for kind in ("ply", "stl", "glb")),
]


@settings(max_examples=300, deadline=None, derandomize=True)
@given(
    st.sampled_from(SEEDS),
    st.lists(st.tuples(st.floats(0, 1), st.binary(max_size=4)), max_size=6),
    st.floats(0, 1),
)
def test_damaged_files_end_in_a_mesh_or_a_reason(seed, edits, end):
    data = bytearray(seed[0])
    for where, what in edits:
        at = int(where * len(data))
        data[at : at + len(what)] = what
    if end < 0.2:
        del data[int(end * 5 * len(data)) :]
    try:
        mesh = clean_mesh(*parse_mesh(bytes(data), seed[1]))
    except BadMeshError:
        pass
    else:
        assert np.isfinite(mesh.vertices).all()
        assert len(mesh.faces)
