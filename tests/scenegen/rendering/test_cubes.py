"""The fast ray caster for cubes gives the same truth as the general one and as Embree."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from other_engines import bits
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial.transform import Rotation

from scenegen.camera import Camera
from scenegen.description.scenes import Light, PlacedObject, SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.rendering.ground_truth import GroundTruth
from scenegen.rendering.numpy_renderer import Cast, render_in_numpy
from scenegen.rendering.packing import SceneBatch, pack
from scenegen.rendering.renderer import launch_fields, render

Array = NDArray[Any]
STRAIGHT = (1.0, 0.0, 0.0, 0.0)
HALF = 1 / np.sqrt(3)  # half edge of a cube of scale 1
SPEC = DatasetSpec(
    height=47, width=61, objects=(1, 6), shapes=("box",), lights=(0, 2), image_dtype="float32",
    min_visible_pixels=0,
)  # fmt: skip
STAIRS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 1], [2, 1, 1]])


def cubes_scene(
    seed: int,
    offsets: Array,
    scale: float = 1.0,
    turn: tuple[float, ...] | None = None,
    middle: tuple[float, float, float] = (0.0, 0.0, 0.0),
    distance: float = 8.0,
    lights: int = 2,
) -> SceneSpec:
    """Cubes of random colours; offsets are in edge lengths, the camera's distance in scales."""
    rng = np.random.default_rng(seed)
    w, x, y, z = turn or rng.normal(size=4)
    rotation = Rotation.from_quat((x, y, z, w))
    edge, around = 2 * HALF * scale, np.array(middle)
    places = around + edge * rotation.apply(offsets - offsets.mean(axis=0))
    x, y, z, w = rotation.as_quat()
    objects = tuple(
        PlacedObject("box", tuple(p), (w, x, y, z), scale, tuple(rng.uniform(0.2, 1, 3)))
        for p in places.tolist()
    )
    back = np.array([0.0, 0.0, 1.0]) if turn else rng.normal(size=3)
    eye = around + distance * scale * back / np.linalg.norm(back)
    some = tuple(
        Light(tuple(around + 9 * scale * d), tuple(rng.uniform(20, 40, 3) * scale**2))
        for d in Rotation.random(lights, random_state=seed).as_matrix()[:, 0]
    )
    camera = Camera(tuple(eye.tolist()), tuple(around.tolist()), 40.0)
    return SceneSpec(seed, (camera,), objects, some, (0.1,) * 3, (0.0, 1.0), None, (0.9, 0.8, 1.0))


def scattered(seed: int, count: int) -> Array:
    """Places between the grid's, where cubes may overlap."""
    return np.random.default_rng(seed).uniform(-1.3, 1.3, (count, 3))


def fast(batch: SceneBatch) -> SceneBatch:
    return replace(batch, cubes_only=True)


def edges(truth: GroundTruth) -> Array:
    """Pixels within one pixel of another cube or of another face."""
    near = maximum_filter(truth.object_id, (0, 3, 3)) != minimum_filter(truth.object_id, (0, 3, 3))
    spread = maximum_filter(truth.normal, (0, 3, 3, 0)) - minimum_filter(truth.normal, (0, 3, 3, 0))
    return near | (spread > 1e-4).any(axis=-1)


def check_same(ours: GroundTruth, theirs: GroundTruth, size: float, slips: float = 0.0) -> None:
    """Check agreement, except for a few pixels on edges and a share `slips` of all pixels."""
    on_edge = edges(theirs)
    same = ours.object_id == theirs.object_id
    close = np.isclose(ours.depth, theirs.depth, rtol=1e-6, atol=4e-6 * size, equal_nan=True)
    aligned = abs(ours.normal - theirs.normal).max(axis=-1) < 1e-5
    alike = abs(ours.image - theirs.image).max(axis=-1) < 1e-4
    for good in (same, close, aligned, alike):
        assert (good | on_edge).mean() >= 1 - slips
        assert good.mean() > 0.99


SCENES = {
    "one cube": [cubes_scene(i, np.zeros((1, 3))) for i in range(4)],
    "polycubes": [cubes_scene(10 + i, STAIRS) for i in range(6)],
    "between the grid": [cubes_scene(20 + i, scattered(i, 1 + i), lights=i % 3) for i in range(6)],
    "tiny to huge": [
        cubes_scene(30 + i, STAIRS, scale, middle=(3 * scale, -scale, 2 * scale))
        for i, scale in enumerate((1e-3, 0.02, 0.37, 7.3, 400.0))
    ],
    "along the axes": [cubes_scene(40 + i, STAIRS[: i + 1], 0.37, STRAIGHT) for i in range(5)],
    "off the axes by rounding": [
        cubes_scene(50 + i, STAIRS, 1.0, (1.0, *(1e-7 * x for x in scattered(i, 1)[0])))
        for i in range(3)
    ],
}


@pytest.mark.parametrize("name", SCENES)
def test_truth_and_image_agree_with_the_generic_kernel_and_with_embree(
    name: str, embree_cast: Cast
) -> None:
    batch = pack(SPEC, SCENES[name])
    ours, generic, other = render(fast(batch)), render(batch), render_in_numpy(batch, embree_cast)
    assert ((ours.object_id > 0).mean(axis=(1, 2)) > 0.02).all()
    assert ours.object_id.min() == -1
    for row, scene in enumerate(SCENES[name]):
        one = slice(row, row + 1)
        a, b, c = (
            GroundTruth(*(v[one] for v in t.pixels().values())) for t in (ours, generic, other)
        )
        size = scene.objects[0].scale
        check_same(a, c, size)
        # Straight at a face, the generic kernel's ray may slip between the face's two triangles.
        check_same(a, b, size, 1e-3 if name == "along the axes" else 0.0)
    missed = ours.object_id == -1
    assert np.isnan(ours.depth[missed]).all()
    assert not ours.normal[missed].any()
    assert (ours.image[missed] == np.float32((0.9, 0.8, 1.0))).all()
    assert (abs(np.linalg.norm(ours.normal[~missed], axis=-1) - 1) < 1e-5).all()


@pytest.mark.parametrize("settings", [{"spp": 4}, {"spp": 3, "shadows": True}, {"shadows": True}])
def test_samples_and_shadows_agree_too(settings: dict[str, Any], embree_cast: Cast) -> None:
    scenes = SCENES["polycubes"][:2] + SCENES["between the grid"][4:]
    batch = pack(replace(SPEC, **settings), scenes)
    ours = render(fast(batch))
    plain = render(fast(pack(SPEC, scenes)))
    assert ours.depth.tobytes() == plain.depth.tobytes()
    assert ours.object_id.tobytes() == plain.object_id.tobytes()
    assert (ours.image != plain.image).any()
    for expected in (render(batch), render_in_numpy(batch, embree_cast)):
        wrong = abs(ours.image - expected.image).max(axis=-1) > 1e-3
        assert wrong.mean() < 5e-3, "but for pixels on edges, and on shadows' borders"


@pytest.mark.parametrize("turn", [STRAIGHT, (0.5, 0.5, 0.5, 0.5), (0.5**0.5, 0.0, 0.5**0.5, 0.0)])
@pytest.mark.parametrize("scale", [0.01, 1.0, 30.0])
def test_a_cube_seen_face_on_is_as_the_ruler_says(turn: tuple[float, ...], scale: float) -> None:
    """The middle row and column of an odd image go straight along an axis of the cube."""
    scene = cubes_scene(0, np.zeros((1, 3)), scale, turn, middle=(5 * scale, 0.0, -scale))
    truth = render(fast(pack(replace(SPEC, height=61), [scene])))
    face = (8 - HALF) * scale
    half_pixels = HALF * scale / face / (2 * np.tan(np.radians(20)) / 61)
    at = abs(np.arange(61) - 30)
    inside = (at[:, None] <= half_pixels) & (at <= half_pixels)
    np.testing.assert_array_equal(truth.object_id[0], np.where(inside, 1, -1))
    np.testing.assert_allclose(truth.depth[0][inside], face, rtol=1e-6)
    assert abs(truth.normal[0][inside] - (0, 0, 1)).max() < 1e-6


def test_no_ray_slips_between_cubes_that_touch() -> None:
    """The eye lies in the plane between them, and straight above the edge where four meet."""
    four = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    for offsets in (four[:2], four):
        scene = cubes_scene(3, offsets, np.sqrt(3) / 2, STRAIGHT, distance=6.0)
        truth = render(fast(pack(replace(SPEC, height=61), [scene])))
        hit = truth.object_id[0] > 0
        rows, columns = np.flatnonzero(hit.any(axis=1)), np.flatnonzero(hit.any(axis=0))
        assert hit[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].all()
        np.testing.assert_allclose(truth.depth[0][hit], 6 * np.sqrt(3) / 2 - 0.5, rtol=1e-6)
    seams = render(fast(pack(replace(SPEC, height=255, width=255), SCENES["polycubes"])))
    whole = render(pack(replace(SPEC, height=255, width=255), SCENES["polycubes"]))
    same = np.isclose(seams.depth, whole.depth, rtol=1e-4, equal_nan=True)
    assert (~same).mean() < 2e-4


@pytest.mark.parametrize("settings", [{}, {"spp": 3, "image_dtype": "uint8"}, {"height": 8}])
def test_an_image_is_the_same_alone_in_every_batch_and_next_to_anything(
    settings: dict[str, Any],
) -> None:
    spec = replace(SPEC, **settings)
    scenes = [scene for some in SCENES.values() for scene in some]
    alone = [bits(render(fast(pack(spec, [scene]))), 0) for scene in scenes]
    for some in (range(len(scenes)), range(len(scenes))[::-1], range(3, 20, 7), (4, 4, 0, 4)):
        together = render(fast(pack(spec, [scenes[i] for i in some])))
        assert [bits(together, row) for row in range(len(some))] == [alone[i] for i in some]


def test_slots_that_are_not_used_change_nothing() -> None:
    scenes = SCENES["polycubes"][:3] + SCENES["one cube"][:1]
    few = fast(pack(replace(SPEC, objects=(1, 5)), scenes))
    many = fast(pack(replace(SPEC, objects=(1, 16)), scenes))
    expected = [bits(render(few), row) for row in range(4)]
    assert [bits(render(many), row) for row in range(4)] == expected
    unused = many.shape < 0
    many.world_from_object[unused] = 5.0
    many.object_scale[unused] = 2.0
    assert [bits(render(many), row) for row in range(4)] == expected


def test_images_without_cubes_show_their_background() -> None:
    empty = replace(SCENES["one cube"][0], objects=())
    truth = render(fast(pack(SPEC, [empty, SCENES["one cube"][1], empty])))
    assert (truth.object_id[[0, 2]] == -1).all()
    assert (truth.image[[0, 2]] == np.float32((0.9, 0.8, 1.0))).all()
    assert bits(truth, 1) == bits(render(fast(pack(SPEC, SCENES["one cube"][1:2]))), 0)


def test_cubes_behind_the_camera_are_not_seen() -> None:
    scene = SCENES["one cube"][0]
    away = Camera((0.0, 0.0, 8.0), (0.0, 0.0, 16.0), 40.0)
    truth = render(fast(pack(SPEC, [replace(scene, cameras=(away,))])))
    assert (truth.object_id == -1).all()


def test_fields_asked_for_alone_are_the_same() -> None:
    batch = fast(pack(SPEC, SCENES["polycubes"]))
    whole: Callable[[str], Array] = render(batch).pixels().__getitem__
    for names in (("object_id",), ("image", "object_id"), ("normal",), ("depth",)):
        for name, values in launch_fields(batch, names)().items():
            assert values.tobytes() == whole(name).tobytes()
