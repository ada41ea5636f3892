"""Pixels of cubes, against the ids that the renderer gives."""

from dataclasses import replace

import numpy as np
import pytest

from iqtt.questions import visibility as module
from iqtt.questions.distractors import Shapes
from iqtt.questions.packing import Question, cube_centres, pack_questions
from iqtt.questions.specs import SplitSpec
from iqtt.questions.views import draw_rotations
from iqtt.questions.visibility import cube_pixels
from iqtt.shapes.chains_and_trees import random_shapes
from iqtt.shapes.polycube import ROTATIONS, bounding_radius
from scenegen.rendering.ground_truth import visible_pixels
from scenegen.rendering.renderer import launch_fields

SPECS = {
    "half the size": SplitSpec(height=64, width=64, min_cube_pixels=1),
    "two words, and bits of a third": SplitSpec(height=90, width=150, min_cube_pixels=1),
    "higher than wide": SplitSpec(height=150, width=50, min_cube_pixels=1),
    "trees": SplitSpec(height=64, width=64, cubes=(3, 16), shapes="tree", min_cube_pixels=1),
    "from near": SplitSpec(height=70, width=64, fov_degrees=90.0, min_cube_pixels=1),
    "hardly any perspective": SplitSpec(height=64, width=64, fov_degrees=5.0, min_cube_pixels=1),
}


def views(spec, count, turns):
    """Centres, numbers of cubes, rotations and distances; the camera is as near as it may be."""
    rng = np.random.default_rng(3)
    sizes = range(spec.cubes[0], spec.cubes[1] + 1)
    pools = [random_shapes(rng, 40, size, spec.shapes) for size in sizes]
    shapes = [pool[i % len(pool)] for i, pool in zip(range(count), count * pools, strict=False)]
    radii = [bounding_radius(one[None])[0] for one in shapes]
    distances = np.array([spec.framing_distance(radius) for radius in radii])
    counts = np.array([len(one) for one in shapes])
    return [cube_centres(shapes, spec.cubes[1]), counts, turns[:count], distances]


def rendered(spec, centres, counts, turns, distances):
    """Count the pixels of the renderer's ids."""
    spec = replace(spec, answers=2)
    dark = np.zeros((3, 2, 3))
    questions = []
    for i in range(len(centres)):
        three = [centres[i, : counts[i]] - centres[i, : counts[i]].min(axis=0)] * 3
        shapes = Shapes(np.rint(three).astype(np.int8), np.array([-1, 0]), 0)
        turned = np.repeat(turns[i : i + 1], 3, axis=0)
        lights = (dark, dark, np.zeros(3))
        questions.append(Question(i, 0, shapes, float(distances[i]), turned, *lights, 0.0))
    ids = launch_fields(pack_questions(spec, questions), ("object_id",))()["object_id"]
    return visible_pixels(ids[::3], spec.cubes[1])


@pytest.mark.parametrize("name", SPECS)
def test_they_are_those_of_the_rendered_ids(name):
    spec, count = SPECS[name], 150
    some = views(spec, count, draw_rotations(np.random.default_rng(4), (count,)))
    size = (spec.height, spec.width)
    found, expected = cube_pixels(size, spec.fov_y_degrees, *some), rendered(spec, *some)
    used = np.arange(spec.cubes[1]) < some[1][:, None]
    assert not found[~used].any()
    assert (expected[used] == 0).mean() > 0.005, "some are hidden"
    assert abs(found - expected).max() <= 1
    assert (found != expected)[used].mean() < 0.005, "but for rays that graze an edge"


def test_views_along_the_axes_agree_but_for_the_pixels_of_an_edge():
    spec = replace(SPECS["half the size"], height=63)
    some = views(spec, 24, ROTATIONS.astype(float))
    found = cube_pixels((63, 64), spec.fov_y_degrees, *some)
    expected = rendered(spec, *some)
    assert (abs(found - expected) <= 0.1 * expected.max()).all()
    assert (found == 0).sum() > 20


def test_company_and_chunks_change_nothing(monkeypatch):
    spec = SPECS["trees"]
    some = views(spec, 60, draw_rotations(np.random.default_rng(5), (60,)))
    whole = cube_pixels((64, 64), spec.fov_y_degrees, *some)
    alone = [cube_pixels((64, 64), spec.fov_y_degrees, *(v[i : i + 1] for v in some))[0]
             for i in range(60)]  # fmt: skip
    assert (whole == alone).all()
    monkeypatch.setattr(module, "VIEWS_AT_ONCE", 7)
    assert (cube_pixels((64, 64), spec.fov_y_degrees, *some) == whole).all()
    assert cube_pixels((64, 64), spec.fov_y_degrees, *(v[:0] for v in some)).shape == (0, 16)
