"""Closed rooms as other tools read them: lengths are metres, and depths fit."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from PIL import Image

from scenegen import open_rooms
from scenegen.objects.catalogue import objects_of
from scenegen.rooms.export.single import export_paths, export_room

DIAGONAL = 8.37  # metres, of the largest room


@pytest.fixture(scope="module")
def deep(interior_path):
    """The room, of which one pixel is as deep as any can be, and one shows the sky."""
    with open_rooms(interior_path) as file:
        room = file[0]
    depth = room.depth.copy()
    depth[0, :2] = DIAGONAL, np.nan
    return replace(room, depth=depth)


def test_the_deepest_room_fits_into_png_files(tmp_path, deep):
    paths = export_paths(0, tmp_path, "a", "png")
    export_room(deep, paths, "png")
    about = json.loads(paths[-1].read_text())
    steps = np.asarray(Image.open(paths[1]))
    assert about["length_unit"] == "metre"
    assert about["depth"]["unit"] == 1e-3  # what readers take steps for
    assert steps[0, 1] == about["depth"]["nothing"] == 0
    known = np.isfinite(deep.depth)
    np.testing.assert_allclose(steps[known] * 1e-3, deep.depth[known], rtol=0, atol=0.501e-3)


def test_meshes_are_those_of_furniture(tmp_path, interior_path):
    with open_rooms(interior_path) as rooms:
        room, objects = rooms[0], objects_of(rooms.spec)
    paths = export_paths(0, tmp_path, "a", "obj")
    export_room(room, paths, "obj")  # without being told the objects
    parts = {name: mesh.bounds for name, mesh in trimesh.load_scene(paths[0]).geometry.items()}
    for k, item in enumerate(room.scene.objects, start=1):
        shape = objects.shape(item.shape)
        bounds = parts[f"object_{k}"]
        size = np.ptp(shape.triangles.reshape(-1, 3)[:, 1]) * item.scale
        assert bounds[1, 1] - bounds[0, 1] == pytest.approx(size, abs=1e-5)
