"""Questions as images: the same bits alone and in company, and what another ray caster sees."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh
from refusals import refused
from trimesh.ray.ray_pyembree import RayMeshIntersector

from iqtt import render as module
from iqtt.questions import views
from iqtt.questions.distractors import make_pools
from iqtt.questions.packing import pack_questions
from iqtt.questions.specs import SplitSpec
from iqtt.questions.views import Tally
from iqtt.render import groups, render_question, render_questions
from iqtt.shapes.polycube import box_centre
from scenegen.camera import pixel_directions
from scenegen.common.errors import PlacementError
from scenegen.rendering.ground_truth import decode_image, encode_image
from scenegen.rendering.renderer import launch_fields
from scenegen.rendering.shading import shade

SPEC = SplitSpec(
    seed=9, train=12, labeled=5, val=4, test=3, cubes=(5, 7), height=40, width=56,
    min_cube_pixels=1, lights=(1, 3), with_depth=True,
)  # fmt: skip
FLOAT = replace(SPEC, image_dtype="float32")


@cache
def pools_of(spec):
    return make_pools(spec)


def rendered(spec, split, group="", **options):
    first, count = groups(spec, split)[group]
    batches = list(render_questions(pools_of(spec), split, first, count, **options))
    size = options.get("batch", module.DEFAULT_BATCH)
    assert all(0 < len(batch) <= size for batch in batches)
    return [one for batch in batches for one in batch]


def bits(one):
    """All that is told of a question, and its pixels."""
    parts = [vars(one), vars(one.question), vars(one.question.shapes)]
    values = [part[name] for part in parts for name in sorted(part)]
    plain = (np.ndarray, int, float)
    return tuple(
        v.tobytes() if isinstance(v, np.ndarray) else v for v in values if isinstance(v, plain)
    )


def look(spec, one, k):
    """Image, cube and depth that trimesh's rays find, and the shading equation gives."""
    cubes = one.question.shapes.cubes[k]
    boxes = [trimesh.creation.box(bounds=[c, c + 1]) for c in cubes.astype(float)]
    mesh = trimesh.util.concatenate(boxes)
    turn = np.eye(4)
    turn[:3, :3] = one.question.world_from_shape[k]
    mesh.apply_translation(-box_centre(cubes[None])[0]).apply_transform(turn)
    rays = pixel_directions(spec.height, spec.width, spec.fov_y_degrees).reshape(-1, 3)
    eye = np.array([0.0, 0.0, one.question.camera_distance])
    points, hit, faces = RayMeshIntersector(mesh).intersects_location(
        np.broadcast_to(eye, rays.shape), rays, multiple_hits=False
    )
    used = slice(0, int(one.question.light_count[k]))
    image = np.tile(np.array(spec.background), (len(rays), 1))
    image[hit] = shade(
        points,
        mesh.face_normals[faces],
        np.array(spec.reflectance),
        one.question.light_position[k, used],
        one.question.light_color[k, used],
        np.array(spec.ambient),
        np.array([0.0, 1.0]),
    )
    cube, depth = np.full(len(rays), -1), np.full(len(rays), np.nan)
    cube[hit], depth[hit] = faces // 12, eye[2] - points[:, 2]
    size = (spec.height, spec.width)
    return image.reshape(*size, 3), cube.reshape(size), depth.reshape(size)


ODD_SPECS = {
    "as ever": FLOAT,
    "bytes": SPEC,
    "one light each": replace(FLOAT, lights=(1, 1)),
    "one to four lights": replace(FLOAT, lights=(1, 4), background=(0.2, 0.5, 0.0)),
    "higher than wide": replace(FLOAT, height=90, width=50, reflectance=(0.9, 0.1, 0.5)),
    "large trees": replace(
        FLOAT, cubes=(8, 8), shapes="tree", distractors="near", min_cube_pixels=0
    ),
    "in a small sphere": replace(FLOAT, cubes=(5, 6), max_radius=2.2, distractors="other"),
    "in a large sphere": replace(FLOAT, max_radius=10.0, height=96, width=96),
    "from near": replace(FLOAT, fov_degrees=90.0, ambient=(0.0, 0.5, 1.0)),
}


@pytest.mark.parametrize("name", ODD_SPECS)
def test_images_are_what_another_ray_caster_and_the_shading_equation_give(name):
    spec = ODD_SPECS[name]
    one = rendered(spec, "val")[1]
    assert one.images.shape == (4, spec.height, spec.width, 3)
    assert one.images.dtype == np.dtype(spec.image_dtype)
    assert (one.depth.shape, one.depth.dtype) == ((4, spec.height, spec.width), np.float32)
    assert one.visible_pixels.shape == (4, spec.cubes[1])
    for k in range(4):
        image, cube, depth = look(spec, one, k)
        hit = cube >= 0
        same = np.isclose(one.depth[k], depth, atol=1e-4, rtol=0, equal_nan=True)
        assert same.mean() > 0.997, "but for edges"
        stored = decode_image(encode_image(image, spec.image_dtype))
        error = abs(decode_image(one.images[k]) - stored).max(axis=2)
        assert (error < (0.005 if spec.image_dtype == "uint8" else 1e-4))[same].mean() > 0.995
        assert np.isnan(one.depth[k]).mean() == pytest.approx((~hit).mean(), abs=0.003)
        shown = np.bincount(cube[hit], minlength=spec.cubes[1])
        assert abs(shown - one.visible_pixels[k]).sum() <= 0.01 * hit.sum() + 2


def test_the_fallback_without_llvm_gives_the_same_images(monkeypatch):
    one = rendered(FLOAT, "val")[3]
    assert len(set(one.question.light_count.tolist())) > 1
    monkeypatch.setattr("scenegen.rendering.renderer.select_variant", lambda device: "scalar_rgb")
    slow = launch_fields(pack_questions(FLOAT, [one.question]), ("image", "depth"))()
    same = np.isclose(slow["depth"], one.depth, atol=1e-4, rtol=0, equal_nan=True)
    assert same.mean() > 0.997
    assert abs(slow["image"] - one.images)[same].max(axis=1).mean() < 1e-4


@pytest.mark.parametrize(
    ("batch", "first", "sampled"), [(1, 16, 512), (3, 7, 1), (64, 1, 1), (2, 1, 5), (4, 2, 4)]
)
def test_neither_batch_nor_how_many_are_sampled_changes_a_bit(batch, first, sampled, monkeypatch):
    tally, expected = Tally(), Tally()
    table = [bits(one) for one in rendered(SPEC, "train", "unlabeled", tally=expected)]
    monkeypatch.setattr(module, "FIRST_SAMPLED", first)
    monkeypatch.setattr(module, "SAMPLED", sampled)
    again = rendered(SPEC, "train", "unlabeled", batch=batch, tally=tally)
    assert [bits(one) for one in again] == table
    assert tally == expected
    assert tally.proposed > 4 * 7


def test_a_cube_hidden_in_the_full_image_after_all_has_its_question_made_anew(monkeypatch):
    """Where the small image is hardly asked, that is often; then too each depends on itself."""
    spec = replace(SPEC, cubes=(7, 7), min_cube_pixels=5)
    monkeypatch.setattr(views, "MARGIN", 0.01)
    table = rendered(spec, "train", "unlabeled", batch=3)
    attempts = [one.question.attempt for one in table]
    assert {0, 1} <= set(attempts)
    for one in table:
        used = one.question.shapes.cubes.shape[1]
        assert (one.visible_pixels[:, :used] >= 5).all()
        assert not one.visible_pixels[:, used:].any()
        assert bits(render_question(pools_of(spec), "train", one.question.index)) == bits(one)


def test_a_request_that_cannot_be_met_ends_after_a_few_questions(monkeypatch):
    for name, value in {"MARGIN": 1000, "QUESTION_ATTEMPTS": 1, "VIEWS": 2}.items():
        monkeypatch.setattr(views, name, value)
    tally = Tally()
    with refused(PlacementError, "train question 0"):
        rendered(replace(SPEC, train=600, labeled=0), "train", "unlabeled", tally=tally)
    assert tally == Tally(2 * module.FIRST_SAMPLED, 2 * module.FIRST_SAMPLED)


def test_every_cube_shows_in_every_image():
    spec = replace(SPEC, height=64, width=64, min_cube_pixels=3, train=60, labeled=0)
    for one in rendered(spec, "train", "unlabeled"):
        used = one.question.shapes.cubes.shape[1]
        assert (one.visible_pixels[:, :used] >= 3).all()
        assert (one.visible_pixels.sum(axis=1) == np.isfinite(one.depth).sum(axis=(1, 2))).all()
        border = np.concatenate([one.depth[:, 0], one.depth[:, -1]], axis=1)
        assert np.isnan(border).all()
        assert np.isnan(one.depth[:, :, [0, -1]]).all()


@pytest.mark.parametrize(
    "changed",
    [{"image_dtype": "float16"}, {"background": (0.0, 0.0, 0.0)}, {"ambient": (0.1,) * 3}],
)
def test_other_settings_of_the_image_leave_shapes_and_views_alone(changed):
    other = replace(FLOAT, **changed)
    for one, plain in zip(rendered(other, "val"), rendered(FLOAT, "val"), strict=True):
        assert one.depth.tobytes() == plain.depth.tobytes()
        assert (one.question.world_from_shape == plain.question.world_from_shape).all()
        assert (one.images != plain.images).any()
