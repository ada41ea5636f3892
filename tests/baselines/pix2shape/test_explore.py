"""Samples, interpolations and rotations: the cameras, lights and codes that are shown."""

import itertools
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import torch
from pix2shape_models import room_source, tiny
from torch.utils.data import default_collate

from baselines.pix2shape import pictures as explore
from baselines.pix2shape.network.surfels import render
from baselines.pix2shape.pictures import (
    drawn,
    image_tiles,
    rotation_frames,
    sheet,
    turned_camera,
)
from scenegen.camera import look_at
from scenegen.description.presets import PAPER_VIEWS
from scenegen.description.specs import DatasetSpec
from scenegen.rooms.reader import RoomsFile
from scenegen.sampling.cameras import sample_cameras
from scenegen.sampling.lights import sample_lights

SPEC = DatasetSpec(height=32, width=32)


def reconstructions(model: Any, source: Any, rows: list[int], seen_as: list[int]) -> Any:
    """Return the tiles of rows' codes, seen from (and lit as) other rows."""
    batch = source.as_batch(default_collate([source[row] for row in rows]))
    views = source.as_batch(default_collate([source[row] for row in seen_as])).views
    with torch.no_grad():
        return drawn(model, model.encode(batch.image, batch.views), views)


def inputs(source: Any, rows: list[int]) -> Any:
    """Return the tiles of rows' own images."""
    return image_tiles(torch.from_numpy(np.stack([source[row]["image"] for row in rows])))


def pixels(picture: Any) -> np.ndarray:
    return np.asarray(picture).astype(int)


def test_turned_by_the_files_angles_is_the_files_views():
    """Views up to 80 degrees leave one side only; both sides come up."""
    spec, sides = replace(SPEC, views=PAPER_VIEWS), []
    for places in sample_cameras(spec, np.arange(30)):
        poses = look_at(places, np.array(spec.camera_target))
        for pose, degrees in zip(poses, PAPER_VIEWS, strict=True):
            found = turned_camera(poses[0], spec, degrees)
            np.testing.assert_allclose(found.world_from_camera, pose, atol=1e-9)
        sides.append(places[0, 0] > places[0, 2])
    assert 5 < sum(sides) < 25


def test_what_is_known_of_views_is_what_training_was_told(several_path):
    source = room_source(several_path, tiny())
    expected = source.as_batch(default_collate([source[row] for row in range(9)])).views
    with RoomsFile(several_path) as rooms:
        spec, depth = rooms.spec, torch.tensor(rooms.read("depth", slice(None)))
    positions = sample_cameras(spec, np.arange(3)).reshape(9, 3)
    count, *lights = (np.repeat(own, 3, axis=0) for own in sample_lights(spec, np.arange(3)))
    assert len(set(count.tolist())) > 1
    found = explore.unrendered_views(spec, positions, *lights, np.zeros((9, 0)))
    assert found.scene.fov_y_degrees == expected.scene.fov_y_degrees
    slots = found.scene.light_color.shape[1]
    there = (found.scene.light_color != 0).any(dim=2)
    assert there.sum(dim=1).tolist() == count.tolist()
    assert not expected.scene.light_color[:, slots:].any()
    close = partial(torch.testing.assert_close, rtol=1e-6, atol=1e-6)
    close(found.condition, expected.condition)
    close(found.scene.light_color, expected.scene.light_color[:, :slots])
    close(found.scene.light_position[there], expected.scene.light_position[:, :slots][there])
    for name in ("ambient", "attenuation", "reflectance"):
        close(getattr(found.scene, name), getattr(expected.scene, name))
    image = render(depth, found.scene)
    torch.testing.assert_close(image, render(depth, expected.scene), rtol=1e-5, atol=1e-6)


def test_an_interpolation_ends_in_the_two_reconstructions(model, several_path):
    source = room_source(several_path, model.config)
    found = pixels(explore.interpolation_sheet(model, source, 3, 7, 5))
    ends, given = reconstructions(model, source, [3, 7], [3, 3]), inputs(source, [3, 7])
    blank = np.full_like(given[0], 250)
    frames = [given, [blank, blank], [blank, blank]]
    first = pixels(sheet([[f[0], e[0]] for f, e in zip(frames, ends, strict=True)]))
    last = pixels(sheet([[e[1], f[1]] for f, e in zip(frames, ends, strict=True)]))
    assert np.abs(found[:, : first.shape[1]] - first).max() <= 2
    assert np.abs(found[:, -last.shape[1] :] - last).max() <= 2
    assert found.shape == (3 * 134 + 6, 7 * 134 + 6, 3)
    steps = [found[:134, 6 + 134 * k : 134 * (k + 1)] for k in range(1, 6)]
    assert all((one != other).any() for one, other in itertools.pairwise(steps))


def test_a_rotation_turns_from_the_reconstructions_to_the_files_other_views(model, several_path):
    source, rows = room_source(several_path, model.config), [6, 0, 3]
    frames = [pixels(frame) for frame in rotation_frames(model, source, rows, [0.0, 35.0, 80.0])]
    given = inputs(source, rows)
    for view, frame in enumerate(frames):
        expected = reconstructions(model, source, rows, [row + view for row in rows])
        assert np.abs(frame - pixels(sheet([given, *expected]))).max() <= 2
    assert (frames[0] != frames[1]).any()
