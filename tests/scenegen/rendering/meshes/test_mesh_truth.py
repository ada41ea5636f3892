"""Rooms of meshes against a caster of another make: Embree on the triangles of the whole scene."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from model_rooms import folder_objects, folder_spec, some_scenes
from numpy.typing import NDArray
from trimesh.ray.ray_pyembree import RayMeshIntersector
from trimesh.triangles import points_to_barycentric

from scenegen.camera import pixel_directions
from scenegen.description.presets import PRESETS, preset_spec
from scenegen.description.scenes import SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.objects.catalogue import Objects, objects_of
from scenegen.objects.scene_mesh import room_mesh
from scenegen.rendering.numpy_renderer import face_viewer
from scenegen.rendering.packing import SceneBatch, pack
from scenegen.rendering.renderer import render

Array = NDArray[Any]
ROOMS = 40
CROPS = {"principal_point": (0.35, 0.3), "pixel_aspect": 1.2, "allow_cropped": True}
FAMILY_PRESETS = [
    name
    for name, it in PRESETS.items()
    if it.settings.get("source") == "families" and not it.kind.interior
]


def cast(batch: SceneBatch, row: int) -> tuple[Array, Array, Array]:
    """Return depth, object id and normal of the pixels of an image, (H W,) and (H W, 3)."""
    room = room_mesh()
    corners = [np.asarray(room.triangles)]
    normals = [np.repeat(room.face_normals[:, None], 3, axis=1)]
    ids = [np.zeros(len(corners[0]), int)]
    for slot in range(int(batch.object_count[row])):
        shape = batch.shape_of(batch.names[batch.shape[row, slot]])
        matrix = batch.world_from_object[row, slot]
        corners.append(shape.triangles @ matrix[:3, :3].T + matrix[:3, 3])
        normals.append(shape.normals @ matrix[:3, :3].T / batch.object_scale[row, slot])
        ids.append(np.full(len(corners[-1]), slot + 1))
    triangles = np.concatenate(corners)
    mesh = trimesh.Trimesh(
        triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), process=False
    )
    camera, size = batch.world_from_camera[row], (batch.spec.height, batch.spec.width)
    rays = pixel_directions(*size, batch.lens(row)).reshape(-1, 3) @ camera[:3, :3].T
    points, hit, faces = RayMeshIntersector(mesh).intersects_location(
        np.broadcast_to(camera[:3, 3], rays.shape), rays, multiple_hits=False
    )
    depth, object_id, normal = np.full(len(rays), np.nan), np.full(len(rays), -1), 0 * rays
    depth[hit] = (camera[:3, 3] - points) @ camera[:3, 2]
    object_id[hit] = np.concatenate(ids)[faces]
    weights = points_to_barycentric(triangles[faces], points)
    smooth = np.einsum("rk,rki->ri", weights, np.concatenate(normals)[faces])
    away = np.einsum("ri,ri->r", mesh.face_normals[faces], rays[hit]) > 0
    normal[hit] = face_viewer(np.where(away[:, None], -smooth, smooth), rays[hit]) @ camera[:3, :3]
    return depth, object_id, normal


def wrong_pixels(spec: DatasetSpec, objects: Objects, scenes: Sequence[SceneSpec]) -> Iterator[int]:
    """Yield how many pixels of each image have another id, depth (1e-4) or normal (1e-3)."""
    for first in range(0, len(scenes), 16):
        batch = pack(spec, scenes[first : first + 16], objects=objects)
        truth = render(batch)
        for row in range(len(batch)):
            depth, object_id, normal = cast(batch, row)
            with np.errstate(invalid="ignore"):
                far = abs(truth.depth[row].ravel() - depth) > 1e-4
            turned = abs(truth.normal[row].reshape(-1, 3) - normal).max(axis=1) > 1e-3
            other = truth.object_id[row].ravel() != object_id
            yield int((far | turned | other).sum())


def hard_meshes(root: Path) -> None:
    """Write an open, a non-manifold, a doubled, a needly, an inside-out and a very fine mesh."""
    rng = np.random.default_rng(0)
    ball = trimesh.creation.icosphere(4)
    vertices = ball.vertices * (1 + 0.1 * np.sin(7 * ball.vertices[:, :1]))
    fan = np.stack(
        [vertices[ball.faces[:, 0]], vertices[ball.faces[:, 1]], 0 * vertices[ball.faces[:, 2]]], 1
    )
    spikes = rng.uniform(-1, 1, (400, 1, 3)) + rng.normal(0, 0.5, (400, 3, 3))
    spikes[:, 2] = spikes[:, 1] + 2e-3 * (spikes[:, 2] - spikes[:, 1])
    fine = trimesh.creation.icosphere(7)
    bumps = 1 + 0.05 * np.sin(fine.vertices @ rng.normal(0, 9, (3, 4))).sum(axis=1, keepdims=True)
    meshes = {
        "open": vertices[ball.faces[::2]],
        "edges": fan[::3],
        "doubled": np.concatenate([vertices[ball.faces], vertices[ball.faces][:, ::-1]]),
        "needles": np.concatenate([spikes, vertices[ball.faces[:300]]]),
        "inside": vertices[ball.faces][:, ::-1],
        "fine": (fine.vertices * bumps)[fine.faces],
        "coarse": trimesh.creation.box((1, 2, 0.4)).triangles,
    }
    for name, triangles in meshes.items():
        (root / name).mkdir()
        mesh = trimesh.Trimesh(
            triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), process=False
        )
        mesh.export(root / name / "0.ply")


@pytest.mark.parametrize(
    ("preset", "rooms", "more"),
    [("shapenet", 4, {}),
     *(pytest.param(name, 40, {}, marks=pytest.mark.slow) for name in FAMILY_PRESETS),
     pytest.param("shapenet", 40, CROPS, marks=pytest.mark.slow)],
)  # fmt: skip
def test_rooms_of_families_agree(preset: str, rooms: int, more: dict[str, Any]) -> None:
    spec = replace(preset_spec(preset), min_visible_pixels=0, **more)
    objects = objects_of(spec)
    wrong = list(wrong_pixels(spec, objects, some_scenes(spec, objects, rooms)))
    assert len(wrong) == rooms
    assert sum(wrong) <= 1e-5 * rooms * spec.height * spec.width


@pytest.mark.slow
def test_rooms_of_hard_meshes_agree(tmp_path: Path) -> None:
    hard_meshes(tmp_path)
    spec = replace(folder_spec(tmp_path), height=128, width=128, shadows=False)
    objects = folder_objects(tmp_path)
    wrong = list(wrong_pixels(spec, objects, some_scenes(spec, objects, ROOMS)))
    assert len(wrong) == ROOMS
    assert sum(wrong) <= 1e-5 * ROOMS * spec.height * spec.width
