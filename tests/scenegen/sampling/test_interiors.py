"""Rooms are furnished by rules: nothing floats, nothing cuts, cameras are free."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from scenegen.camera import Lens, look_at
from scenegen.common.errors import PlacementError
from scenegen.common.rotations import rotation_matrix
from scenegen.description.presets import preset_spec
from scenegen.objects.catalogue import objects_of
from scenegen.sampling.interiors import viewpoints
from scenegen.sampling.interiors.spaces import Box, Space, clear_of
from scenegen.sampling.interiors.viewpoints import SMALL
from scenegen.sampling.proposals import ProposalQueue
from scenegen.sampling.scenes import sample_scenes

SPEC = preset_spec("interiors", seed=3, height=64, width=64, objects=(12, 40))
COUNT = 6


@pytest.fixture(scope="module")
def scenes():
    """Return one scene of each item, from its first attempt that found room."""
    queue = ProposalQueue(SPEC, range(COUNT), objects_of(SPEC))
    drawn = queue.take(COUNT, COUNT)
    return [drawn.scene(k) for k in range(len(drawn))]


def corners(item):
    """Return the triangles of a placed object, world, (F, 3, 3)."""
    shape = objects_of(SPEC).shape(item.shape)
    turned = shape.triangles @ rotation_matrix(item.rotation).T
    return item.scale * turned + item.position


def spans(triangles):
    """Return the least and greatest coordinates along upright and level directions, (2, 49)."""
    turns = np.arange(48) / 48 * np.pi
    flat = np.stack([np.cos(turns), 0 * turns, np.sin(turns)], axis=1)
    along = triangles.reshape(-1, 3) @ np.concatenate([flat, [[0, 1, 0]]]).T
    return np.stack([along.min(axis=0), along.max(axis=0)])


def kept_apart(a, b):
    """Return whether a plane keeps what spans `a` and `b` apart, of those tried."""
    return bool(((a[1] < b[0]) | (b[1] < a[0])).any())


def overlap(a, b):
    """Return whether boxes of triangles (F, 3, 3) and (G, 3, 3) overlap anywhere."""
    low, high = b.min(axis=(0, 1)), b.max(axis=(0, 1))
    return bool(((a.min(axis=1) < high) & (a.max(axis=1) > low)).all(axis=1).any())


def test_nothing_cuts_into_anything_else(scenes):
    for scene in scenes:
        meshes = [corners(item) for item in scene.objects]
        taken = [spans(mesh) for mesh in meshes]
        on = scene.interior.stands_on
        for i, j in itertools.combinations(range(len(meshes)), 2):
            if not kept_apart(taken[i], taken[j]):
                child, parent = (i, j) if on[i] == j + 1 else (j, i)
                assert on[child] == parent + 1
                turn = rotation_matrix(scene.objects[parent].rotation)
                assert not overlap(meshes[parent] @ turn, meshes[child] @ turn)


def test_nothing_floats(scenes):
    for scene in scenes:
        for k, (item, on) in enumerate(zip(scene.objects, scene.interior.stands_on, strict=True)):
            low = corners(item)[..., 1].min()
            if on:
                tops = corners(scene.objects[on - 1])
                level = np.ptp(tops[..., 1], axis=1) < 1e-3
                heights = tops[level][..., 1].ravel()
                assert np.abs(heights - low).min() < 2e-3, (k, item.shape)
            elif item.name not in ("picture", "clock", "curtain", "pendant"):
                sills = [hole.bottom for hole in scene.interior.openings]
                assert min(abs(low - y) for y in (0.0, *sills)) < 0.02, (k, item.shape)


def test_cameras_are_free_and_nearly_level(scenes):
    for scene in scenes:
        (camera,) = scene.cameras
        position = np.array(camera.position)
        assert 0.8 <= position[1] <= 1.8
        assert 45 <= camera.fov_y_degrees <= 75
        assert (position[[0, 2]] >= 0.3).all()
        assert (position[[0, 2]] <= np.array(scene.interior.size)[[0, 2]] - 0.3).all()
        down = camera.world_from_camera[:3, 2] @ (0, 1, 0)
        assert abs(np.degrees(np.arcsin(down))) <= 15
        for item in scene.objects:
            away = np.linalg.norm(corners(item).reshape(-1, 3) - position, axis=1).min()
            assert away >= 0.3


def test_small_objects_cut_by_the_lower_edge_are_counted_as_projections_of_points_say():
    rng, lens, counts = np.random.default_rng(0), Lens(50.0, (0.4, 0.6)), []
    grid = lens.grid(60, 80)
    for _ in range(200):
        place, target = np.array([0, 1.4, 0.0]), np.array([0, rng.uniform(1.0, 1.8), -3.0])
        boxes = [
            Box(*rng.uniform((-2, -3), (2, 0)), tuple(rng.uniform(0.02, 0.4, 2)), low,
                low + rng.uniform(0.05, 1.0), rng.random())
            for low in rng.uniform(0, 1, 12)
        ]  # fmt: skip
        expected = 0
        for box in boxes:
            corners = [(x, y, z) for x, z in box.corners() for y in (box.bottom, box.top)]
            matrix = look_at(place, target)
            x, y, z = ((corners - place) @ matrix[:3, :3]).T
            small = np.hypot(*box.half) < SMALL and box.top - box.bottom < 2 * SMALL
            if small and (z < 0).all():
                column, row = grid.places(x, y, -z)
                beside = column.max() < 0 or column.min() > 80
                expected += not beside and row.min() < 60 < row.max()
        axes = viewpoints._axes(tuple(place), tuple(target))
        counts.append(
            viewpoints._cut(tuple(place), axes, viewpoints._table(boxes), lens.edges(60, 80))
        )
        assert counts[-1] == expected
    assert max(counts) > 1


def test_a_scene_is_the_same_alone_and_among_others():
    objects = objects_of(SPEC)
    together, scenes = sample_scenes(SPEC, [0, 1, 2], [1, 1, 1], objects)
    for row, index in enumerate(np.flatnonzero(together).tolist()):
        _, alone = sample_scenes(SPEC, [index], [1], objects)
        assert alone.to_json(0) == scenes.to_json(row) == alone.scene(0).to_json()


def test_rooms_that_cannot_hold_their_objects_are_refused(monkeypatch):
    monkeypatch.setattr("scenegen.sampling.scenes.MAX_FURNISHED", 2)
    spec = preset_spec("interiors", shapes=("bed",), objects=(30, 30))
    with pytest.raises(PlacementError):
        ProposalQueue(spec, range(1), objects_of(spec)).take(1, 1)


def test_boxes_are_within_the_walls_and_below_the_ceiling():
    space = Space((4.0, 2.5, 6.0), 9)
    for x, z, top, inside in (
        (2.0, 5.4, 2.4, True),
        (2.0, 5.6, 2.4, False),
        (3.6, 3.0, 2.4, False),
        (2.0, 3.0, 2.49, False),
    ):
        assert space.within(Box(x, z, (0.5, 0.5), 0.0, top, 0.0)) == inside
    assert not space.within(Box(2.0, 5.4, (0.5, 0.5), 0.0, 2.4, 0.125)), "turned by 45 degrees"
    assert not space.within(Box(2.0, 3.0, (0.5, 0.5), -0.1, 2.4, 0.0))


@pytest.mark.parametrize(("turns", "clear"), [(0.125, True), (-0.125, False)])
def test_a_child_is_clear_of_its_parents_triangles_in_the_parents_frame(turns, clear):
    """A long box between the two sides of a shelf that is turned by 45 degrees."""
    sides = (
        np.array([[-0.3, 0.0, -0.3], [-0.3, 0.0, 0.2]]),
        np.array([[0.3, 1, -0.2], [0.3, 1, 0.3]]),
    )
    shelf = Box(1.0, 2.0, (0.3, 0.3), 0.0, 1.0, 0.125)
    child = Box(1.0, 2.0, (0.25, 0.05), 0.1, 0.4, turns)
    assert clear_of(SimpleNamespace(boxes=sides), shelf, child) == clear
