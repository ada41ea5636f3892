"""Rules of single rows at their limits; `test_verify` has whole files."""

from types import SimpleNamespace

import numpy as np
import pytest

from scenegen.rooms.row_rules import _depth_problems, _image_problems


@pytest.mark.parametrize(
    ("missed", "hit", "count"),
    [(np.nan, 1.0, 0), (np.inf, 1.0, 1), (2.0, 1.0, 1), (np.nan, 0.0, 1), (np.nan, np.inf, 1)],
)
def test_depth_is_a_positive_number_just_where_something_is_hit(missed, hit, count):
    room = SimpleNamespace(
        depth=np.array([[missed, hit]]),
        object_id=np.array([[-1, 1]]),
        scene=SimpleNamespace(interior=None),
    )
    assert len(list(_depth_problems(room, np.zeros((1, 2, 3))))) == count


@pytest.mark.parametrize(
    ("radiance", "count"), [(0.3, 0), (0.078, 0), (0.073, 1), (-0.1, 1), (np.nan, 1)]
)
def test_with_shadows_no_pixel_is_darker_than_ambient_light(radiance, count):
    """By more than a step of 8 bits: 0.8 times 0.1 here."""
    spec = SimpleNamespace(shading="phong", spp=1, shadows=True, own_reflectance=False)
    room = SimpleNamespace(
        radiance=np.array([[[0.3] * 3, [radiance] * 3]]), object_id=np.array([[0, 1]])
    )
    batch = SimpleNamespace(
        reflectance=np.full((1, 3, 3), 0.8),
        ambient=np.full((1, 3), 0.1),
        object_count=np.array([1]),
    )
    assert len(list(_image_problems(spec, room, None, batch, False))) == count
