"""What the audit measures of pictures and reads of stored frames, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from iqtt.audit.features.frames import stored_frames
from iqtt.audit.features.statistics import measure, shape_statistics, silhouettes
from iqtt.audit.proofs.shapes import compare_shapes
from iqtt.files.layout import NO_CUBE
from iqtt.shapes.polycube import ROTATIONS, mirror
from scenegen.common.rotations import rotation_matrix

WHITE = np.array([255, 255, 255], np.uint8)


def rectangles():
    """One question of white images, (1, 4, 40, 60, 3) uint8: two rectangles, a step, nothing."""
    images = np.full((1, 4, 40, 60, 3), 255, np.uint8)
    images[0, 0, 10:20, 20:50] = (51, 102, 153)
    images[0, 1, 30:34, 2:10, :2] = 0
    images[0, 2, 5:25, 5:15] = 100
    images[0, 2, 5:15, 15:25] = 200
    return images


def measured(images):
    return measure(images, silhouettes(images, WHITE))


def test_sizes_places_and_light_are_those_reckoned_by_hand():
    found = measured(rectangles())[0]
    assert found["area"] * 2400 == pytest.approx([300, 32, 300, 0])
    assert found["extent"] == pytest.approx(np.hypot([10, 4, 20, 0], [30, 8, 20, 0]))
    assert found["offset"] == pytest.approx(np.hypot([5, 12, 5, 0], [5, 24, 15, 0]))
    assert found["brightness"] == pytest.approx([0.4, 1 / 3, 400 / 3 / 255, 0], rel=1e-5)
    assert found["mean_color"][0] == pytest.approx([0.2, 0.4, 0.6], rel=1e-5)
    step = np.std([100, 100, 200]) / 255
    assert found["contrast"] == pytest.approx([0, 0, step, 0], rel=1e-6, abs=1e-6)
    assert found["image_brightness"][0] == pytest.approx(0.4 / 8 + 7 / 8, rel=1e-6)
    assert found["colors"][2].max() == pytest.approx(2 / 3)
    assert found["colors"].sum(axis=1) == pytest.approx([1, 1, 1, 0])


def test_spreads_of_a_rectangle_and_the_skew_of_a_step():
    moments = measured(rectangles())["moments"][0]
    assert moments[0, :2] == pytest.approx(np.sqrt((np.array([30, 10]) ** 2 - 1) / 12) / 40)
    assert moments[0, 2:] == pytest.approx([0, 0], abs=1e-4)
    assert (moments[2, 2:] > 0.01).all()


def test_turning_and_mirroring_an_image_change_no_outline():
    rng = np.random.default_rng(1)
    images = np.full((2, 4, 32, 32, 3), 255, np.uint8)
    images[:, :, 6:30, 3:20] = rng.integers(0, 2, (2, 4, 24, 17, 1)) * 255
    before = measured(images)
    for after in (images[:, :, :, ::-1], np.rot90(images, axes=(2, 3))):
        found = measured(np.ascontiguousarray(after))
        for name in ("area", "extent", "offset", "moments", "brightness", "contrast", "colors"):
            assert found[name] == pytest.approx(before[name], abs=1e-6)


def test_rounding_is_no_silhouette():
    images = np.ones((1, 4, 16, 16, 3), np.float32)
    images[0, 0, 3, 3] -= 1e-4
    images[0, 1, 3, 3, 1] = 0.99
    images[0, 2, 3, 3, 1] = np.nan
    shown = silhouettes(images, np.ones(3, np.float32))
    assert shown.sum(axis=(0, 2, 3)).tolist() == [0, 1, 1, 0]


class Table(SimpleNamespace):
    """What proofs look at, of the cubes of some questions, (Q, 4, n, 3)."""

    @property
    def images(self):
        return self.cubes.shape[1]

    def __len__(self):
        return len(self.cubes)


def test_numbers_of_shapes():
    rod = np.array([[x, 0, 0] for x in range(4)], np.int8)
    square = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.int8)
    ell = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0]], np.int8)
    twist = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 1]], np.int8)
    questions = [
        [rod, rod, square, ell],
        [twist, mirror(twist), twist, rod],
        [ell, twist, ell, rod],
    ]
    unused = ((0, 0), (0, 0), (0, 5), (0, 0))
    cubes = np.pad(np.array(questions), unused, constant_values=NO_CUBE)
    tables = [Table(cubes=some) for some in (cubes[:2], cubes[2:])]
    found = compare_shapes(tables)
    first, second = shape_statistics(
        [one.cubes for one in tables],
        [one.class_name for one in found],
        [one.whole for one in found],
    )
    assert first[0].tolist() == [[3, 1.25, 2], [4, 0.5, 0], [3, 0.875, 1]]
    # A mirror image is the same class; those of the question itself do not count.
    assert first[1, :, 2].tolist() == [1, 1, 2]
    assert second[0, :, 2].tolist() == [2, 1, 2]


CUBES = np.array([[2, 1, 0], [0, 0, 0], [1, 0, 0], [2, 0, 0], [NO_CUBE] * 3], np.int8)


def about_x(degrees):
    half = np.radians(degrees) / 2
    return rotation_matrix(np.array([np.cos(half), np.sin(half), 0, 0]))


def test_turns_and_orders():
    ordered = CUBES[[1, 2, 3, 0, 4]]  # in the order of their coordinates but for the last
    cubes = np.stack([CUBES, CUBES, ordered])[None]
    views = np.stack([about_x(20), about_x(65), about_x(-10)])[None]
    angle, same, own, place = stored_frames(cubes, views, np.array([True]))[0, :, :4].T
    np.testing.assert_allclose(angle, [45, 30], atol=1e-5)
    np.testing.assert_allclose(own, [65, 10], atol=1e-5)
    assert same.tolist() == [4, 0]
    assert place.tolist() == [0, 4]
    between = stored_frames(cubes, views, np.array([True]))[0, 0, 4:13].reshape(3, 3)
    np.testing.assert_allclose(between @ views[0, 0], views[0, 1], atol=1e-12)


def test_a_common_frame_changes_what_is_told_in_a_known_way():
    """The symmetric part is that of the turn between the frames, which pictures do not show."""
    views = np.stack([np.eye(3), ROTATIONS[1], ROTATIONS[2]])[None]
    cubes = np.stack([CUBES] * 3)[None]
    found = stored_frames(cubes, views, np.array([True]))[0, :, 13:]
    for k in (1, 2):
        expected = (ROTATIONS[k] + ROTATIONS[k].T)[np.triu_indices(3)]
        assert found[k - 1].tolist() == expected.tolist()
