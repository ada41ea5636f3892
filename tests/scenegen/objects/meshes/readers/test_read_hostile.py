"""Files of meshes that are too large, damaged, or no files at all: a reason, and soon."""

import os
import time
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from known_meshes import CORNERS, OBJ, SPHERE

from scenegen.objects.meshes import read
from scenegen.objects.meshes.clean import clean_mesh
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.read import parse_mesh, read_mesh
from scenegen.objects.meshes.readers import polygons, text_formats


def test_faces_that_would_take_hours_are_refused_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    lines = [f"v {x} {y} 0" for x, y in rng.random((150_000, 2))]
    lines.append("f " + " ".join(map(str, range(1, 150_001))))
    started = time.process_time()
    with pytest.raises(BadMeshError, match="faces of 150000 corners"):
        parse_mesh("\n".join(lines).encode(), ".obj")
    assert time.process_time() - started < 10
    monkeypatch.setattr(polygons, "MOST_FACES", 1000)
    monkeypatch.setattr(text_formats, "MOST_CORNERS", 6000)
    for more, words in (
        (b"f 1 2 3\n" * 1500, "has 1500 faces, at most 1000"),
        (b"f 1 2 3\n" * 2500, "faces have more than 6000 corners"),
        (b"v 1 2 3\n" * 6000, "has more than 6000 vertices"),
    ):
        with pytest.raises(BadMeshError, match=words):
            parse_mesh(CORNERS.encode() + more, ".obj")


def test_huge_counts_in_small_files_take_no_memory() -> None:
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 900000000000\nproperty float x\n"
    with pytest.raises(BadMeshError, match="more than there is"):
        parse_mesh(f"{head}end_header\n".encode(), ".ply")
    with pytest.raises(BadMeshError, match="cut short"):
        parse_mesh(b"OFF\n900000000000 900000000000 0\n1 2 3\n", ".off")
    with pytest.raises(BadMeshError, match="0 of 4294967295 triangles"):
        parse_mesh(bytes(80) + b"\xff\xff\xff\xff", ".stl")


def test_files_that_are_no_files(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def refusal(name: str) -> str:
        with pytest.raises(BadMeshError) as refused:
            read_mesh(tmp_path / name)
        return str(refused.value)

    (tmp_path / "empty.obj").touch()
    (tmp_path / "blank.obj").write_bytes(b" \r\n\0\0\n" * 100)
    (tmp_path / "folder.obj").mkdir()
    (tmp_path / "loop.obj").symlink_to(tmp_path / "loop.obj")
    (tmp_path / "gone.obj").symlink_to(tmp_path / "nothing")
    os.mkfifo(tmp_path / "pipe.obj")  # reading it would never end
    (tmp_path / "a.fbx").write_text("x")
    (tmp_path / "picture.glb").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(99))
    assert refusal("empty.obj") == refusal("blank.obj") == "the file is empty"
    assert refusal("folder.obj") == refusal("pipe.obj") == "is no regular file"
    assert refusal("none.obj") == refusal("loop.obj") == refusal("gone.obj")
    assert refusal("none.obj") == "the file does not exist"
    assert "'.fbx', expected one of .glb, .obj" in refusal("a.fbx")
    assert "does not start with glTF" in refusal("picture.glb")
    (tmp_path / "big.obj").write_text(OBJ["plain"])
    monkeypatch.setattr(read, "MOST_BYTES", 50)
    assert refusal("big.obj") == "has more than 50 bytes; simplify it"


SEEDS = [
    (OBJ["textured"].encode(), ".obj"),
    (SPHERE.export(file_type="ply")[:4000], ".ply"),
    (trimesh.creation.box().export(file_type="ply", encoding="ascii"), ".ply"),
    (trimesh.creation.box().export(file_type="ply"), ".ply"),
    (trimesh.creation.box().export(file_type="off").encode(), ".off"),
    (trimesh.creation.box().export(file_type="stl"), ".stl"),
    (trimesh.creation.box().export(file_type="stl_ascii").encode(), ".stl"),
    (trimesh.creation.box().export(file_type="glb"), ".glb"),
]


@settings(max_examples=300, deadline=None, derandomize=True)
@given(
    st.sampled_from(SEEDS),
    st.lists(st.tuples(st.floats(0, 1), st.binary(max_size=4)), max_size=6),
    st.floats(0, 1),
)
def test_damaged_files_end_in_a_mesh_or_a_reason(
    seed: tuple[bytes, str], edits: list[tuple[float, bytes]], end: float
) -> None:
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
