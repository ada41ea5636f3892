"""Cubes: a picture of a chiral shape gives that shape, and bad pictures give answers as well."""

import itertools

import h5py
import numpy as np
import pytest

pytest.importorskip("numba")

from baselines.cubes.answer import answer_scores, decode, explain, obeys_rules, write_cubes
from baselines.cubes.filling import SIDE
from baselines.cubes.segmentation import labelings
from iqtt.questions.specs import SplitSpec
from iqtt.shapes.polycube import ROTATIONS, canonical, is_chiral, mirror

SPEC = SplitSpec()
HALF = np.tan(np.radians(SPEC.fov_y_degrees) / 2)
CHAIN = np.array(
    [(0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 1, 0), (2, 2, 0), (2, 2, 1), (2, 2, 2), (1, 2, 2)]
)
COLORS = np.array([(200, 90, 60), (80, 140, 60), (50, 60, 130)])


def rotation(x, y):
    """Return a turn about x after one about y, radians."""
    (a, b), (c, d) = (np.cos(x), np.sin(x)), (np.cos(y), np.sin(y))
    return np.array([(1, 0, 0), (0, a, -b), (0, b, a)]) @ np.array(
        [(c, 0, d), (0, 1, 0), (-d, 0, c)]
    )


def drawn(cubes, turn):
    """Return a picture of cubes, by the nearest of all boxes that each ray meets."""
    centres = cubes - (cubes.min(axis=0) + cubes.max(axis=0)) / 2
    n, distance = SPEC.height, SPEC.framing_distance(3.0)
    at = ((np.arange(n) + 0.5) * 2 / n - 1) * HALF
    x, y = np.meshgrid(at, -at)
    rays = np.stack([x, y, -np.ones_like(x)], axis=-1) @ turn
    origin = np.array([0, 0, distance]) @ turn
    image, nearest = np.full((n, n, 3), 255), np.full((n, n), np.inf)
    for centre in centres:
        slabs = np.sort([(centre + s - origin) / rays for s in (-0.5, 0.5)], axis=0)
        near, axis = slabs[0].max(axis=-1), slabs[0].argmax(axis=-1)
        hit = (near < slabs[1].min(axis=-1)) & (near < nearest)
        nearest[hit], image[hit] = near[hit], COLORS[axis][hit]
    return image.astype(np.uint8)


@pytest.mark.slow
def test_a_picture_gives_its_shape_and_not_the_mirror_image():
    assert is_chiral(CHAIN[None])[0]
    image = drawn(CHAIN, rotation(0.5, 0.7))
    shape = decode(image, SPEC)
    assert (canonical(shape.cubes[None]) == canonical(CHAIN[None])).all()
    assert shape.misfit < 0.03
    assert (decode(image, SPEC).cubes == shape.cubes).all()
    other = decode(drawn(CHAIN @ ROTATIONS[7].T, rotation(-0.6, 0.4)), SPEC)
    wrong = decode(drawn(mirror(CHAIN), rotation(-0.6, 0.4)), SPEC)
    assert explain(shape, other) < 0.05 < explain(shape, wrong)


@pytest.mark.parametrize("sigma", [0, 4])
def test_a_noisy_picture_has_the_labels_of_its_faces(sigma):
    image = drawn(CHAIN, rotation(0.5, 0.7))
    truth = (image[..., None, :] == COLORS).all(axis=-1) @ np.array([1, 2, 3])
    noise = np.random.default_rng(0).normal(0, sigma, image.shape)
    labels = next(labelings(np.clip(image + noise, 0, 255).round(), np.full(3, 255.0)))
    orders = [np.array((0, *order)) for order in itertools.permutations((1, 2, 3))]
    assert max((order[labels] == truth).mean() for order in orders) > 0.999


@pytest.mark.parametrize(
    "image", ["empty", *(pytest.param(n, marks=pytest.mark.slow) for n in ("one colour", "noise"))]
)
def test_a_picture_without_a_shape_has_scores(image):
    images = np.full((4, 64, 64, 3), 255, np.uint8)
    if image == "one colour":
        images[:, 20:40, 20:40] = 90
    elif image == "noise":
        images = np.random.default_rng(0).integers(0, 256, images.shape).astype(np.uint8)
    assert np.isfinite(
        answer_scores(images, SplitSpec(height=64, width=64, min_cube_pixels=8))
    ).all()


def test_only_shapes_of_the_split_count():
    def obeys(cubes):
        filled = np.zeros((SIDE, SIDE, SIDE), bool)
        filled[tuple(np.transpose(cubes))] = True
        return obeys_rules(filled.ravel(), np.full(3, -SIDE / 2 - 0.5), SPEC)

    middle = CHAIN + SIDE // 2 - 1  # its box has three cells along each axis
    assert obeys(middle)
    assert not obeys(middle + 1)
    assert not obeys(middle[:-1])
    cross = [(5 + a, 5, 5) for a in range(-2, 3)] + [(5, 5 + a, 5) for a in (-2, -1, 1, 2)]
    assert not obeys(cross)  # it branches


def test_a_released_file_is_answered(tmp_path):
    with h5py.File(tmp_path / "test.h5", "w") as file:
        images = np.ones((2, 4, 32, 32, 3), np.float32)
        images[1, 0, 9, 9:12:2] = [[np.nan] * 3, [0.5] * 3]
        file["questions"] = images
    write_cubes(tmp_path / "test.h5", tmp_path / "out.h5")
    with h5py.File(tmp_path / "out.h5") as file:
        assert file["scores"].shape == (2, 3)
        assert (file["scores"][:] == -1).all()
