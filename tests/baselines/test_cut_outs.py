"""Floors without 3D: masks from the shading alone, and what each submission is made of."""

import numpy as np
import pytest

from baselines.cut_outs import LEARNING, LIFT, WITHOUT_TRAINING, blob_balls, outline_mask
from baselines.trivial import write_room_baseline
from metrics.measures.relief import empty_room
from metrics.scoring.evaluate import score
from scenegen.camera import back_project, look_at, pixel_directions, transform_points

CAMERA = look_at(np.array([2.3, 1.7, 2.1]), np.array([0.3, 0.25, 0.3]))
FOV = 24.0


def shaded(mask):
    """A picture of the empty room by two lights, and of something darker or brighter before it."""
    depth, normal = empty_room(CAMERA, FOV, 48, 48)
    points = transform_points(CAMERA, back_project(depth, FOV))
    faces = normal @ CAMERA[:3, :3].T
    image = np.full((48, 48, 3), 0.1)
    for light, colour in (([2, 3, 1], [0.5, 0.4, 0.4]), ([1, 2, 3], [0.2, 0.3, 0.4])):
        way = np.array(light) - points
        far = np.linalg.norm(way, axis=-1)
        falls = np.maximum((faces * way).sum(axis=-1) / far, 0.0) / (0.3 * far + 0.1 * far**2)
        image += falls[..., None] * colour
    image[mask] = 0.5 * image[mask] + 0.02 * np.random.default_rng(0).random((mask.sum(), 3))
    return np.round(np.clip(image, 0.0, 1.0) * 255.0) / 255.0


def test_what_the_shading_of_walls_does_not_explain_is_an_object():
    y, x = np.mgrid[:48, :48]
    mask = ((x - 20) ** 2 + (y - 25) ** 2 < 60) | ((np.abs(x - 36) < 4) & (np.abs(y - 30) < 6))
    found = outline_mask(shaded(mask), CAMERA, FOV)
    assert (found & mask).sum() / (found | mask).sum() > 0.9
    assert not outline_mask(shaded(np.zeros_like(mask)), CAMERA, FOV).any()


@pytest.fixture(scope="module")
def submissions(make_rooms, tmp_path_factory):
    folder = tmp_path_factory.mktemp("cut-outs")
    truth = make_rooms(folder / "rooms.h5", 6, views=(0.0, 80.0), height=48, width=48)
    train = make_rooms(folder / "train.h5", 12, views=(0.0, 80.0), height=48, width=48, seed=9)
    found = {}
    for name in (*WITHOUT_TRAINING, *LEARNING):
        path = folder / f"{name}.h5"
        write_room_baseline(name, truth, path, train=train if name in LEARNING else None)
        found[name] = score([path], truth)
    return folder, truth, found


def test_a_cut_out_finds_its_floor_to_the_digit_and_all_find_outlines(submissions):
    found = submissions[2]
    flat = found["cut-out"]
    assert flat.items["shape_error"] == pytest.approx(
        flat.items["cut_out_shape_error"], nan_ok=True
    )
    assert flat.skills["shape_error"].value == pytest.approx(0.0, abs=1e-4)
    assert flat.metrics["shape_correlation"].value == pytest.approx(0.0, abs=1e-2)
    assert flat.metrics["relief_iou"].value > 0.8
    for name in ("picture-outline", "outline-regression", "outline-relief"):
        assert found[name].skills["relief_iou"].value > 0.3, name
    assert {name: file.shown for name, file in found.items() if file.shown != "scored_view"} == {
        "balls": "first_view"
    }


def test_a_ball_takes_the_place_of_its_blob():
    empty = np.full((64, 64), 2.0)
    rays = pixel_directions(64, 64, FOV)
    centre = np.array([0.1, -0.05, -1.9])
    inside = (rays @ centre) ** 2 > (rays**2).sum(axis=-1) * (centre @ centre - 0.12**2)
    (ball,) = blob_balls(inside, empty, FOV)
    middle = (2.0 - LIFT) / (1.0 - ball[3] / -ball[2] * 2.0 / 3.0)
    assert -ball[2] == pytest.approx(middle)
    assert ball[:3] / -ball[2] == pytest.approx(centre / 1.9, abs=0.01)
    assert ball[3] / -ball[2] == pytest.approx(0.12 / 1.9, rel=0.03)
