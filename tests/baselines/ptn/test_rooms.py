"""Batches of rooms: rays and silhouettes agree with a known ball, mirrored or not."""

import h5py
import numpy as np
from ptn_models import tiny, volume_of, voxel_centres
from refusals import refused

from baselines.ptn.projection import silhouettes
from baselines.ptn.rooms import TrainingRooms
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.rooms.reader import RoomsFile

BALL = {"shapes": ("sphere",), "objects": (1, 1), "views": (0.0, 35.0, 80.0), "seed": 4}
BIG = {"height": 64, "width": 64, "object_radius": (0.12, 0.16)}


def ball(path, model, mirrored):
    """Return the volume of the one ball of a file's scene."""
    with RoomsFile(path) as rooms:
        place = rooms.read("object/world_from_object", 0)[0, :3, 3]
        radius = float(rooms.read("object/scale", 0)[0])
    place = place[::-1] if mirrored else place
    return volume_of(np.linalg.norm(voxel_centres(model) - place, axis=-1) - radius, 0.04)


def test_a_ball_is_where_all_views_of_a_batch_see_it(make_rooms, tmp_path):
    path = make_rooms(tmp_path / "ball.h5", 1, **BALL, **BIG)
    model = tiny(batch=6, rays=300, size=32)
    with RoomsFile(path) as rooms:
        places = rooms.read("camera/world_from_camera", slice(None))[:, :3, 3]
    seen = set()
    with RoomsFile(path) as rooms:
        batch = TrainingRooms(rooms, model.settings).batch(np.random.default_rng(0))
    assert batch.image.shape == (6, 3, 32, 32)
    assert 0.02 < batch.silhouette.mean() < 0.5
    for item in range(6):
        camera = batch.camera[item].numpy()
        assert camera[0] >= camera[2]
        mirrored = np.abs(places - camera).sum(axis=1).min() > 1e-3
        seen.add(bool(mirrored))
        rays = batch.origin[item][None], batch.direction[item][None]
        found = silhouettes(ball(path, model, mirrored), model.box, *rays, 64)[0] > 0.5
        assert (found != (batch.silhouette[item] > 0)).float().mean() < 0.03
    assert seen == {False, True}


def test_files_that_tell_too_little_are_refused(make_rooms, tmp_path):
    single = make_rooms(tmp_path / "one.h5", 2)
    odd = make_rooms(tmp_path / "odd.h5", 1, height=36, width=32, **BALL)
    blind = make_rooms(tmp_path / "blind.h5", 1, **BALL)
    with h5py.File(blind, "r+") as file:
        file["camera/world_from_camera"][1] = np.nan
    for path, kind, where, hint in (
        (single, SpecError, "scene 0", "--views"),
        (odd, SpecError, "odd.h5", ""),
        (blind, FileFormatError, "row 1", ""),
    ):
        with RoomsFile(path) as rooms, refused(kind, where, hint=hint):
            TrainingRooms(rooms, tiny().settings)
