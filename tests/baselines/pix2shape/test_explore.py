"""Samples, interpolations and rotations: the cameras, lights and codes that are shown."""

from dataclasses import replace
from typing import Any

import numpy as np
import torch
from pix2shape_models import room_source
from torch.utils.data import default_collate

from baselines.pix2shape.pictures import drawn, image_tiles, rotation_frames, sheet, turned_camera
from scenegen.camera import look_at
from scenegen.description.presets import PAPER_VIEWS
from scenegen.description.specs import DatasetSpec
from scenegen.sampling.cameras import sample_cameras

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


def test_a_rotation_turns_from_the_reconstructions_to_the_files_other_views(model, several_path):
    source, rows = room_source(several_path, model.config), [6, 0, 3]
    frames = [pixels(frame) for frame in rotation_frames(model, source, rows, [0.0, 35.0, 80.0])]
    given = inputs(source, rows)
    for view, frame in enumerate(frames):
        expected = reconstructions(model, source, rows, [row + view for row in rows])
        assert np.abs(frame - pixels(sheet([given, *expected]))).max() <= 2
    assert (frames[0] != frames[1]).any()
