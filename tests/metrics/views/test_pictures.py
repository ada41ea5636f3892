"""Pictures of views: what their colours say, and values that are hard to draw."""

import base64
import io

import numpy as np
import pytest
from PIL import Image

from metrics.views.pictures import (
    DEPTH,
    DERIVED_NORMALS,
    ERROR,
    LARGEST,
    NORMALS,
    NOT_SCORED,
    TRUE_DEPTH,
    TRUE_NORMALS,
    data_url,
    depth_pictures,
    normal_pictures,
)

LARGEST_ERROR = [252, 254, 164]


def decoded(url):
    data = base64.b64decode(url.removeprefix("data:image/webp;base64,"))
    return np.asarray(Image.open(io.BytesIO(data)))


def test_pictures_show_depth_on_the_truths_scale_and_errors_up_to_a_tenth_of_it():
    true = np.array([[1.0, 2.0], [3.0, np.nan]])
    predicted = np.array([[1.0, 2.2], [0.0, 5.0]])
    up = np.tile([0.0, 1.0, 0.0], (2, 2, 1))
    pictures = depth_pictures(np.zeros((2, 2, 3), np.uint8), true, predicted)
    pictures += normal_pictures(true, predicted, up, 50.0, 7 * up)
    shown = {picture.caption: decoded(picture.url) for picture in pictures}
    assert {p.caption: p.ends for p in pictures if p.bar == "error"} == {ERROR: ("0", "≥ 0.2")}
    assert {p.ends for p in pictures if p.bar == "depth"} == {("1.000", "3.000")}
    truth, depth, error = (shown[name] for name in (TRUE_DEPTH, DEPTH, ERROR))
    assert truth[0, 0].tolist() == depth[1, 0].tolist() == [68, 1, 84]
    assert truth[1, 0].tolist() == [253, 231, 36]
    assert error[0, 0].tolist() == [0, 0, 3]
    assert error[0, 1].tolist() == error[1, 0].tolist() == LARGEST_ERROR
    assert tuple(truth[1, 1]) == tuple(depth[1, 1]) == tuple(error[1, 1]) == NOT_SCORED
    assert shown[NORMALS][0, 0].tolist() == shown[TRUE_NORMALS][0, 0].tolist() == [128, 255, 128]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300, -1.0, 0.0])
def test_any_prediction_can_be_drawn(value):
    true = np.full((4, 4), 2.0)
    normal = np.full((4, 4, 3), value)
    for given in (None, normal):
        predicted = np.full((4, 4), value)
        pictures = depth_pictures(np.ones((4, 4, 3), np.uint8), true, predicted)
        pictures += normal_pictures(true, predicted, normal, 50.0, given)
        urls = {picture.caption: picture.url for picture in pictures}
        assert (DERIVED_NORMALS in urls) == (given is None)
        assert decoded(urls[ERROR])[0, 0].tolist() == LARGEST_ERROR


def test_pictures_are_small_however_large_the_image():
    noise = np.random.default_rng(0).integers(0, 256, (1000, 700, 3), np.uint8)
    assert max(decoded(data_url(noise)).shape[:2]) <= LARGEST
    assert len(data_url(noise)) * 18 * 6 < 2_500_000
