"""An image does not depend on the other images of its batch, down to the last bit."""

from dataclasses import replace

import numpy as np
import pytest
from other_engines import bits

from scenegen.camera import Camera
from scenegen.description.scenes import PlacedObject, SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import render

ODD = DatasetSpec(
    height=37, width=53, objects=(1, 4), lights=(0, 3), attenuation=(0.2, 0.6), seed=2,
    min_visible_pixels=0,
)  # fmt: skip


@pytest.fixture(scope="module")
def scenes(scenes_of):
    """Scenes in which every object and the room has its own colour."""
    rng = np.random.default_rng(9)
    colored = []
    for scene in scenes_of(ODD, 11):
        paint = [tuple(rng.uniform(0.2, 1.0, 3).tolist()) for _ in range(5)]
        objects = tuple(replace(item, reflectance=paint[k]) for k, item in enumerate(scene.objects))
        colored.append(replace(scene, objects=objects, room_reflectance=paint[4]))
    return colored


@pytest.mark.parametrize("settings", [{"image_dtype": "float32", "shadows": True, "spp": 3}, {}])
def test_an_image_is_the_same_alone_and_in_every_batch(settings, scenes):
    spec = replace(ODD, **settings)
    alone = [bits(render(pack(spec, [scene])), 0) for scene in scenes]
    assert len(set(alone)) == len(alone)
    for rows in (range(3), range(3, 11), range(10, -1, -1)):
        together = render(pack(spec, [scenes[row] for row in rows]))
        assert [bits(together, i) for i in range(len(rows))] == [alone[row] for row in rows]


def test_neighbours_cannot_change_a_bit_of_an_image(scenes):
    """Image 1 among empty, crowded and very bright scenes, and objects as large as the room."""
    spec = replace(ODD, shadows=True, image_dtype="float32")
    middle = scenes[1]
    expected = bits(render(pack(spec, scenes[:3])), 1)
    giant = PlacedObject("box", (0.5, 0.5, 0.5), (1.0, 0.0, 0.0, 0.0), 5.0, (1.0, 1.0, 1.0))
    dark = replace(scenes[0], objects=(giant,) * 4, lights=())
    bright = tuple(replace(light, color=(1e6, 1e6, 1e6)) for light in middle.lights)
    bare = replace(scenes[2], objects=(), lights=bright, room_reflectance=None)
    for before, after in ((dark, dark), (bare, bare), (dark, bare), (middle, middle)):
        assert bits(render(pack(spec, [before, middle, after])), 1) == expected


@pytest.mark.parametrize("room", [None, (1.0, 1.0, 1.0)])
def test_nothing_but_the_background_is_seen_where_no_room_is(room):
    camera = Camera((0.5, 0.5, 3.0), (0.5, 0.4, 9.0 if room else 0.0), 30.0)
    black, sky = (0.0, 0.0, 0.0), (0.25, 0.5, 1.0)
    spec = replace(ODD, image_dtype="float32", spp=2)
    scenes = [
        SceneSpec(i, (camera,), (), (), (1.0, 1.0, 1.0), (1.0, 1.0), room, background)
        for i, background in enumerate((black, sky))
    ]
    truth = render(pack(spec, scenes))
    assert (truth.object_id == -1).all()
    assert np.isnan(truth.depth).all()
    assert not truth.normal.any()
    assert not truth.image[0].any()
    assert (truth.image[1] == sky).all()
