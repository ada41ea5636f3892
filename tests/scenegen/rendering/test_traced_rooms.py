"""Path-traced images: the same ground truth bit for bit, and light with known answers."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import minimum_filter

from scenegen.camera import Camera
from scenegen.description.names import FAMILY_NAMES
from scenegen.description.scenes import Light, PlacedObject, SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import render

PATH = DatasetSpec(
    height=24, width=32, shading="path", spp=4, image_dtype="float32", min_visible_pixels=0,
    objects=(1, 2), lights=(0, 3), seed=3,
)  # fmt: skip
TARGET = PATH.camera_target
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
BALL = PlacedObject("sphere", TARGET, UPRIGHT, 0.2, (0.8, 0.5, 0.3))
CAMERA = Camera((0.3, 0.6, 1.8), TARGET, 18.0)
LAMP = Light((1.3, 1.9, 1.5), (3.0, 2.0, 1.0))
BLACK = (0.0, 0.0, 0.0)
OPEN = SceneSpec(0, (CAMERA,), (BALL,), (LAMP,), BLACK, (0.0, 1.0), None)


def images(scene, **settings):
    """Return the traced image, the shading equation's, and a mask inside the first object."""
    spec = replace(PATH, **{"spp": 64, **settings})
    traced = render(pack(spec, [scene])).image[0]
    paper = render(pack(replace(spec, shading="paper"), [scene]))
    return traced, paper.image[0], minimum_filter(paper.object_id[0] == 1, 3)


@pytest.mark.parametrize(
    "settings",
    [{}, {"specular": (0.1, 0.5)}, {"source": "families", "shapes": FAMILY_NAMES}],
    ids=["matte", "glossy", "models"],
)
def test_only_the_colour_is_traced(settings, scenes_of):
    spec = replace(PATH, **settings)
    scenes = scenes_of(replace(spec, shading="paper"), 3)
    traced = render(pack(spec, scenes))
    paper = render(pack(replace(spec, shading="paper", spp=1), scenes))
    for name in ("depth", "normal", "object_id"):
        assert getattr(traced, name).tobytes() == getattr(paper, name).tobytes()
    assert traced.image.shape == paper.image.shape
    assert traced.image.dtype == np.float32
    assert np.isfinite(traced.image).all()
    assert traced.image.min() >= 0
    assert (traced.image != paper.image).mean() > 0.5


def test_noise_is_another_for_every_seed_scene_and_view():
    """The images show the same scene, each with different noise."""
    views = (CAMERA, CAMERA)
    room = replace(OPEN, cameras=views, room_reflectance=(0.7,) * 3, ambient=(0.1,) * 3)
    spec = replace(PATH, spp=16)
    scenes = [room, replace(room, index=1)]
    batch = pack(spec, scenes, (0, 1))
    found = [*render(batch).image, *render(pack(replace(spec, seed=4), scenes, (0, 1))).image]
    assert len({image.tobytes() for image in found}) == 8
    assert [*render(batch).image][2].tobytes() == found[2].tobytes()
    means = np.array([image.mean() for image in found])
    assert means.std() < 0.02 * means.mean()


@pytest.mark.parametrize(
    ("shape", "gloss"),
    [
        ("sphere", (0.0, 1.0)),
        ("cylinder", (0.5, 6.0)),
        pytest.param("sphere", (0.5, 6.0), marks=pytest.mark.slow),
        pytest.param("cylinder", (0.0, 1.0), marks=pytest.mark.slow),
    ],
)
def test_direct_light_of_an_open_convex_object_is_the_shading_equation(shape, gloss):
    """With k_l = 0 light falls off with the inverse square, and nothing else reflects light."""
    item = replace(BALL, shape=shape, specular=gloss[0], shininess=gloss[1])
    traced, paper, inside = images(replace(OPEN, objects=(item,)), specular=(0.0, 1.0))
    assert inside.mean() > 0.15
    assert paper[inside].max() > 0.3
    assert traced[inside].mean(axis=0) == pytest.approx(paper[inside].mean(axis=0), rel=0.01)
    lit = inside & (paper > 0.05).all(axis=-1)
    off = abs(traced / np.maximum(paper, 0.05) - 1)[lit].max(axis=-1)
    assert np.quantile(off, 0.8) < 0.03, "up to noise and outlines"


def test_ambient_light_alone_leaves_an_open_object_its_reflectance():
    """The furnace test: every point of a convex object sees L_a all around."""
    scene = replace(OPEN, lights=(), ambient=(0.5, 0.25, 0.125), background=(0.25, 0.5, 1.0))
    traced, _, inside = images(scene, spp=256)
    expected = np.array(BALL.reflectance) * scene.ambient
    np.testing.assert_allclose(traced[inside].mean(axis=0), expected, rtol=0.02)
    assert (traced[0] == np.float32(scene.background)).all(), "what lies beyond is no light"


def test_a_glossy_object_in_the_furnace_reflects_both_lobes():
    """Facing the viewer, rho + 2 k_s / (m + 1); towards the outline the lobe is cut off."""
    item = replace(BALL, specular=0.6, shininess=5.0, scale=0.2)
    camera = Camera((0.3, 0.3 + 1e-3, 1.8), TARGET, 2.0)
    scene = replace(OPEN, objects=(item,), cameras=(camera,), lights=(), ambient=(0.5,) * 3)
    traced, _, inside = images(scene, specular=(0.0, 1.0), spp=256)
    assert inside.all()
    expected = 0.5 * (np.array(item.reflectance) + 2 * 0.6 / 6)
    np.testing.assert_allclose(traced.mean(axis=(0, 1)), expected, rtol=0.02)


def test_walls_block_light_from_behind(variant):
    behind = Light((-1.0, 0.5, 0.5), (1.0,) * 3)
    room = replace(OPEN, objects=(), lights=(behind,), room_reflectance=(0.7,) * 3)
    image = render(pack(replace(PATH, objects=(0, 1)), [room])).image
    assert (image == 0).all()


def test_it_is_the_picture_of_mitsubas_own_path_tracer(variant):
    """Of a room with a ball and a box, from Mitsuba's shapes, lights, materials and integrator."""
    import mitsuba as mi

    camera = Camera((1.3, 1.0, 1.4), TARGET, 40.0)
    ball = replace(BALL, position=(0.35, 0.2, 0.35))
    box = PlacedObject("box", (0.6, 0.15, 0.3), UPRIGHT, 0.2, (0.3, 0.7, 0.8))
    lights = (LAMP, Light((0.4, 1.6, 1.2), (0.5, 1.0, 2.0)))
    scene = SceneSpec(0, (camera,), (ball, box), lights, (0.3, 0.2, 0.1), (0.6, 0.4), (0.7,) * 3)
    spec = replace(PATH, height=48, width=64, spp=512)
    ours = render(pack(spec, [scene]))

    to = mi.ScalarTransform4f

    def thing(kind, place, color):
        matte = {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(color)}}
        return {"type": kind, "to_world": place, "bsdf": {"type": "twosided", "bsdf": matte}}

    wall = to().translate([0.5, 0.5, 0]).scale(0.5)
    contents = {
        "ambient": {"type": "constant", "radiance": {"type": "rgb", "value": [0.3, 0.2, 0.1]}},
        "ball": thing("sphere", to().translate(ball.position).scale(0.2), ball.reflectance),
        "box": thing("cube", to().translate(box.position).scale(0.2 / 3**0.5), box.reflectance),
        "back": thing("rectangle", wall, (0.7,) * 3),
        "left": thing("rectangle", to().rotate([0, 1, 0], 90) @ to().rotate([0, 0, 1], 90) @ wall,
                      (0.7,) * 3),
        "floor": thing("rectangle", to().rotate([1, 0, 0], 90) @ wall, (0.7,) * 3),
    }  # fmt: skip
    for number, light in enumerate(lights):
        away = float(np.linalg.norm(np.subtract(light.position, TARGET)))
        power = np.pi * np.array(light.color) * away / (0.6 + 0.4 * away)
        contents[f"light{number}"] = {
            "type": "point", "position": list(light.position),
            "intensity": {"type": "rgb", "value": power.tolist()},
        }  # fmt: skip
    film = {"type": "hdrfilm", "width": 64, "height": 48, "rfilter": {"type": "box"}}
    view = to().look_at(origin=camera.position, target=TARGET, up=[0, 1, 0])
    sensor = {"type": "perspective", "fov": 40.0, "fov_axis": "y", "to_world": view, "film": film}
    path = mi.load_dict({"type": "path", "max_depth": 8, "hide_emitters": True})
    loaded = mi.load_dict({"type": "scene", "sensor": sensor, **contents})
    theirs = np.array(mi.render(loaded, integrator=path, spp=512))[..., :3]
    for k in range(3):
        inside = minimum_filter(ours.object_id[0] == k, 3)
        assert inside.sum() > 80
        a, b = ours.image[0][inside], theirs[inside]
        np.testing.assert_allclose(a.mean(axis=0), b.mean(axis=0), rtol=0.01)
        assert np.quantile(np.abs(a / b - 1), 0.9) < 0.08
