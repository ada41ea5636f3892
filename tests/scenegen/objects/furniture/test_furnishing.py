"""Furniture: closed, standing, of plausible size, with supports and textures that lie on it."""

import numpy as np
import pytest
import trimesh
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh

from scenegen.description.names import FAMILY_NAMES
from scenegen.objects.families.members import member_shape
from scenegen.objects.furniture.furnishing import CLEAR, FAMILIES_FACTS, WHOLE, furnishing, supports
from scenegen.objects.furniture.unwrapping import stretches

FAMILIES = pytest.mark.parametrize("family", FAMILIES_FACTS)
NEW = pytest.mark.parametrize("family", [f for f in FAMILIES_FACTS if f not in FAMILY_NAMES])
NUMBERS = (0, 1, 2, 3, 4, 6, 13, 500, 999)


def things(family, numbers=NUMBERS):
    return (furnishing(family, number) for number in numbers)


@FAMILIES
def test_furniture_is_closed_and_stands_centred_within_its_sizes(family):
    facts = FAMILIES_FACTS[family]
    for thing in things(family):
        corners = thing.vertices[thing.faces]
        for patch in range(thing.patch.max() + 1):
            body = trimesh.Trimesh(**trimesh.triangles.to_kwargs(corners[thing.patch == patch]))
            assert body.is_watertight, (family, thing.number, patch)
            assert body.is_winding_consistent
            assert body.volume > 0.0
        low, high = thing.vertices.min(axis=0), thing.vertices.max(axis=0)
        assert abs(low[1]) < 1e-6
        np.testing.assert_allclose((low + high)[[0, 2]], 0.0, atol=1e-6)
        assert facts.height[0] <= high[1] <= facts.height[1]
        if facts.width:
            assert facts.width[0] - 1e-6 <= high[0] - low[0] <= facts.width[1] + 1e-6


@NEW
def test_new_meshes_are_of_good_quality(family):
    for thing in things(family):
        corners = thing.vertices[thing.faces]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(across, axis=1)
        assert 40 <= len(area) <= 7000
        assert area.min() > 1e-8
        agree = np.einsum("fi,fki->fk", across / area[:, None], thing.corner_normals)
        assert agree.min() > 0.0
        assert np.quantile(agree, 0.01) > 0.5
        np.testing.assert_allclose(np.linalg.norm(thing.corner_normals, axis=2), 1.0, atol=1e-6)


@FAMILIES
def test_textures_are_not_stretched(family):
    for thing in things(family):
        whole = np.array([kind in WHOLE for kind in thing.materials])[thing.part]
        corners = thing.vertices[thing.faces][~whole]
        least, most = stretches(corners, thing.corner_uv[~whole])
        assert least.min(initial=1.0) > 0.3
        assert most.max(initial=1.0) < 3.0
        shown = thing.corner_uv[whole]
        assert ((shown >= -1e-9) & (shown <= 1 + 1e-9)).all()


def test_the_grain_of_wood_runs_along_boards():
    shelf = next(t for t in things("shelf", range(30)) if t.materials[0] == "wood")
    corners, uv = shelf.vertices[shelf.faces], shelf.corner_uv
    for patch in np.unique(shelf.patch[shelf.part == 0]):
        own = shelf.patch == patch
        sizes = np.ptp(corners[own].reshape(-1, 3), axis=0)
        longest = int(np.argmax(sizes))
        steps = np.diff(corners[own], axis=1).reshape(-1, 3)
        along = np.abs(steps).argmax(axis=1) == longest
        straight = along & (np.sort(np.abs(steps), axis=1)[:, 1] < 1e-9)
        moves = np.diff(uv[own], axis=1).reshape(-1, 2)[straight]
        assert len(moves)
        np.testing.assert_allclose(np.abs(moves[:, 1]), np.abs(steps[straight, longest]), atol=1e-6)


@FAMILIES
def test_supports_lie_on_the_surface_and_are_free(family):
    facts = FAMILIES_FACTS[family]
    found = 0
    for thing in things(family):
        rectangles = supports(thing)
        found += len(rectangles)
        scene = rtcore_scene.EmbreeScene()
        TriangleMesh(scene, thing.vertices[thing.faces].astype(np.float32))
        for y, x0, x1, z0, z1 in rectangles:
            assert x0 < x1
            assert z0 < z1
            share = np.random.default_rng(0).random((60, 2))
            places = [x0, z0] + share * [x1 - x0, z1 - z0]
            start = np.insert(places, 1, y + CLEAR - 1e-3, axis=1).astype(np.float32)
            down = np.tile(np.float32([0, -1, 0]), (60, 1))
            depth = scene.run(start, down, query="DISTANCE")
            np.testing.assert_allclose(depth, CLEAR - 1e-3, atol=2e-4)
    assert bool(found) == (facts.surfaces or facts.seats)


@NEW
def test_the_body_for_placing_contains_the_shape(family):
    for number in NUMBERS[:3]:
        shape = member_shape(family, number)
        directions = np.random.default_rng(1).normal(size=(200, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        reach = (shape.mesh.vertices @ directions.T).max(axis=0)
        flat = np.hypot(directions[:, 0], directions[:, 2])
        body = (shape.hull_points @ directions.T + np.outer(shape.hull_discs, flat)).max(axis=0)
        assert (body > reach - 1e-6).all()
        assert (body < reach + 0.03).all()
