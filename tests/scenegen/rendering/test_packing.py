"""Packed scenes: each number is in its slot, and unused slots are empty."""

from dataclasses import replace

import numpy as np
import pytest

from scenegen.camera import Camera
from scenegen.common.errors import SpecError
from scenegen.description.scenes import Light, PlacedObject, SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.rendering.packing import pack

SPEC = DatasetSpec(objects=(0, 3), lights=(0, 2), shapes=("cone", "box"), height=50, width=80)
TURN = (0.5, 0.5, 0.5, 0.5)
CONE = PlacedObject("cone", (0.1, 0.2, 0.3), TURN, 0.15, (0.1, 0.2, 0.3))
BOX = PlacedObject("box", (0.4, 0.5, 0.6), (1.0, 0.0, 0.0, 0.0), 0.05, (0.4, 0.5, 0.6))
LAMP = Light((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
VIEWS = (
    Camera((1.5, 1.0, 1.2), (0.3, 0.3, 0.3), 28.0),
    Camera((1.0, 1.1, 1.9), (0.2, 0.3, 0.3), 33.0),
)
FULL = SceneSpec(
    4, VIEWS, (BOX, CONE), (LAMP, LAMP), (0.1, 0.2, 0.3), (0.5, 0.6), (0.7, 0.8, 0.9), (1, 2, 3)
)
BARE = replace(FULL, index=5, objects=(), lights=(), room_reflectance=None)
LAST = replace(FULL, index=6, objects=(CONE,), lights=(LAMP,))


@pytest.mark.parametrize("start", range(4))
@pytest.mark.parametrize("count", [1, 2, 5])
def test_rows_are_a_part_of_every_array(start, count):
    batch = pack(SPEC, [FULL, BARE, LAST], (0, 1))
    rows = slice(start, start + count)
    some = batch.rows(rows)
    assert len(some) == min(count, 6 - start)
    named = [[some.names[i] if i >= 0 else None for i in row] for row in some.shape.tolist()]
    known = [
        [batch.names[i] if i >= 0 else None for i in row] for row in batch.shape[rows].tolist()
    ]
    assert named == known
    assert some.names == batch.names, "basic shapes are all listed, used or not"
    assert some.shape.dtype == batch.shape.dtype
    for name in ("spec", "shape_of", "cubes_only"):
        assert getattr(some, name) is getattr(batch, name)
    for name, values in vars(batch).items():
        if isinstance(values, np.ndarray) and name != "shape":
            np.testing.assert_array_equal(getattr(some, name), values[rows], err_msg=name)


@pytest.mark.parametrize("views", [(2,), (0, 2), (-1,), (0, -1), (1, 5)])
def test_views_that_a_scene_lacks_are_refused(views):
    """-1 must not mean the last view."""
    with pytest.raises(SpecError) as refused:
        pack(SPEC, [FULL], views)
    error = refused.value
    assert (error.where, error.found) == ("scene 4", ", ".join(map(str, views)))
    assert error.expected == "views from 0 to 1"


def test_models_are_known_by_class_and_number():
    spec = replace(SPEC, source="families", shapes=("mug", "can"))
    mug, can = replace(CONE, shape="mug/0007"), replace(BOX, shape="can/0001")
    batch = pack(spec, [replace(FULL, objects=(mug, can, mug)), replace(LAST, objects=(can,))])
    assert batch.names == ("can/0001", "mug/0007")
    assert batch.shape.tolist() == [[1, 0, 1], [0, -1, -1]]
    assert batch.shape_of("mug/0007").name == "mug/0007"
    with pytest.raises(SpecError, match="'bowl'"):
        pack(spec, [replace(FULL, objects=(replace(CONE, shape="bowl/0001"),))])


@pytest.mark.parametrize(
    ("change", "where", "found"),
    [
        ({"objects": (BOX,) * 4}, "scene 4", "4 objects"),
        ({"lights": (LAMP,) * 3}, "scene 4", "3 lights"),
        ({"objects": (replace(BOX, shape="torus"),)}, "scene shapes", "['torus']"),
    ],
)
def test_a_scene_beyond_the_request_is_refused(change, where, found):
    with pytest.raises(SpecError) as refused:
        pack(SPEC, [BARE, replace(FULL, **change)])
    assert (refused.value.where, refused.value.found) == (where, found)
