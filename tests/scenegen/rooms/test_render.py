"""Scenes on their way to rows."""

from scenegen.description.presets import preset_spec
from scenegen.rooms.render import render_items


def test_scenes_whose_pictures_take_long_are_handed_on_one_by_one():
    small = {"height": 24, "width": 32, "spp": 1, "objects": (4, 4), "min_visible_pixels": 0}
    ready = list(render_items(preset_spec("interiors", **small), range(3), 64))
    assert [[room.index for room in rooms] for rooms in ready] == [[0], [1], [2]]
