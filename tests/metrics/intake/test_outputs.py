"""What models return becomes geometry in our conventions and size, or is refused by name."""

import numpy as np
import pytest

from metrics.intake.outputs import KEYS, OutputError, read_output
from metrics.intake.resampling import filled, nearest, resampled
from scenegen.camera import pixel_directions

D = np.full((4, 6), 2.0)
POINTS = np.dstack([0 * D, 0 * D + 0.5, D])  # x right, y down, z forward
OURS = np.dstack([0 * D, 0 * D - 0.5, -D])
CAMERA = np.array([[0.8, 0.0, 0.5], [0.0, 1.2, 0.5], [0.0, 0.0, 1.0]])
FOV = np.degrees(2 * np.arctan(0.5 / 1.2))


def read(key=None, frame="opencv", missing="refuse", **output):
    return read_output(output, 4, 6, key=key, frame=frame, missing=missing)


def tensor(values):
    return pytest.importorskip("torch").tensor(values)


@pytest.mark.parametrize("key", KEYS)
def test_the_keys_say_what_is_predicted(key):
    """The first of `KEYS` that is there is taken, unless one is asked for."""
    kind, alignment = KEYS[key]
    layers = np.dstack([D, D + 1])
    stored, expected = {"points": (POINTS, OURS), "layers": (layers, layers)}.get(kind, (D, D))
    others = dict.fromkeys(list(KEYS)[list(KEYS).index(key) + 1 :], stored + 9)
    for output in ({key: stored, "other": "x"}, {key: stored, **others}):
        got = read(**output)
        assert (got.kind, got.alignment, got.key) == (kind, alignment, key)
        np.testing.assert_array_equal(got.geometry, expected)
    assert read(key, **dict.fromkeys(KEYS, stored)).key == key


@pytest.mark.parametrize(
    "stored",
    [D.astype("f2"), D[None, ..., None], tensor(D), D.tolist(), np.kron(D, np.ones((3, 3)))],
    ids=["half", "axes of 1", "tensor", "list", "another size"],
)
def test_values_of_many_kinds(stored):
    np.testing.assert_array_equal(read(depth_metric=stored).geometry, D)


def test_normals_cameras_and_frames():
    normal = np.dstack([0 * D, 0 * D + 3.0, -D])
    got = read(depth_metric=D, normal=normal, intrinsics=CAMERA)
    assert got.normal[1, 2].tolist() == [0.0, -3.0, 2.0]
    assert got.fov_y_degrees == pytest.approx(FOV)
    in_pixels = CAMERA * [[6.0], [4.0], [1.0]]
    got = read(frame="opengl", points_metric=OURS, normal=normal, intrinsics=in_pixels[None])
    assert got.normal[1, 2].tolist() == [0.0, 3.0, -2.0]
    np.testing.assert_array_equal(got.geometry, OURS)
    assert got.fov_y_degrees == pytest.approx(FOV)


def test_a_mask_takes_values_out():
    depth, mask = D + np.arange(6), np.arange(6) * (D > 0) > 2
    absent = np.isnan(read(depth_metric=depth, mask=mask).geometry[0])
    assert absent.tolist() == [True] * 3 + [False] * 3
    filled = read(depth_metric=depth, mask=mask, missing="nearest").geometry
    assert filled[3].tolist() == [5.0] * 3 + [5.0, 6.0, 7.0]


BAD = {
    "an array": (D, "returned"),
    "None": (None, "returned"),
    "other keys": ({"depth": D}, "returned"),
    "a key that is not there": ({"depth_metric": D}, "returned", "depth_scale_invariant"),
    "text": ({"depth_metric": "far"}, "depth_metric"),
    "shape": ({"depth_metric": D[0]}, "depth_metric"),
    "transposed": ({"depth_metric": D.T}, "depth_metric"),
    "another ratio": ({"depth_metric": D[:, :4]}, "depth_metric"),
    "NaN": ({"depth_metric": D * np.nan}, "depth_metric"),
    "zeros": ({"depth_metric": np.where(np.eye(4, 6), 0, D)}, "depth_metric"),
    "channels first": ({"points_metric": POINTS.transpose(2, 0, 1)}, "points_metric"),
    "mask": ({"depth_metric": D, "mask": D[1:] > 0}, "mask"),
    "camera": ({"depth_metric": D, "intrinsics": D}, "intrinsics"),
    "no focal length": ({"depth_metric": D, "intrinsics": 0 * CAMERA}, "intrinsics"),
    "normal": ({"depth_metric": D, "normal": D}, "normal"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_prediction_is_named(name):
    output, where, *key = BAD[name]
    with pytest.raises(OutputError) as caught:
        read_output(output, 4, 6, key=key[0] if key else None)
    assert caught.value.where == where
    assert len(str(caught.value).splitlines()) == 1


def plane(height, width):
    """Planar depth (h, w) of a slanted plane: n.p = -1 with p = depth * ray."""
    rays = pixel_directions(height, width, 50.0)
    return -1.0 / (rays @ np.array([0.2, -0.3, 0.5]))


def of_kind(kind, height, width):
    depth = plane(height, width)
    rays = pixel_directions(height, width, 50.0)
    return {"depth": depth, "disparity": 3.0 / depth + 1.0, "points": rays * depth[..., None]}[kind]


@pytest.mark.parametrize("kind", ["depth", "disparity", "points"])
@pytest.mark.parametrize("size", [(96, 128), (60, 80), (300, 400)])
def test_a_plane_is_exact(kind, size):
    """But for a border that a coarser image does not reach."""
    inside = np.s_[2:-2, 2:-2]
    got = resampled(kind, of_kind(kind, *size), 72, 96)
    assert np.allclose(got[inside], of_kind(kind, 72, 96)[inside], rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", ["depth", "disparity"])
def test_no_value_lies_between_the_sides_of_an_edge(kind):
    step = np.where(np.arange(40) < 17, 1.0, 2.0) * np.ones((30, 1))
    for size in ((64, 64), (11, 13)):
        assert set(np.unique(resampled(kind, step, *size).round(12))) == {1.0, 2.0}


def test_pixels_without_a_value_spread_to_no_other():
    values = np.full((20, 20), 2.0)
    values[4:9, 4:9] = np.nan
    got = resampled("depth", values, 40, 40)
    assert np.array_equal(np.isnan(got), np.kron(np.isnan(values), np.ones((2, 2), bool)))
    assert np.array_equal(got, nearest(values, 40, 40), equal_nan=True)


def test_filled_from_the_nearest():
    values = np.array([[1.0, np.nan, np.nan, np.nan, 2.0]])
    assert filled(values, np.isfinite(values)).tolist() == [[1.0, 1.0, 1.0, 2.0, 2.0]] or (
        filled(values, np.isfinite(values)).tolist() == [[1.0, 1.0, 2.0, 2.0, 2.0]]
    )
