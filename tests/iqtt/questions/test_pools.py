"""What questions are drawn from: each split's own shapes, or a refusal before anything is made."""

from dataclasses import replace

import numpy as np
import pytest

from iqtt.questions import sampling as questions
from iqtt.questions.sampling import draw_shapes, make_pools
from iqtt.questions.specs import SplitSpec
from iqtt.shapes.polycube import bounding_radius, set_ids
from iqtt.shapes.sampling import TooFewShapesError
from scenegen.common.errors import SpecError

SPEC = SplitSpec(seed=11, cubes=(6, 8), max_radius=2.7)


def test_the_seed_decides_which_split_has_which_classes():
    one, other = (make_pools(replace(SPEC, cubes=(7, 7), seed=seed)) for seed in (2**63 - 1, 0))
    for a, b in zip(one.catalogues[7].splits, other.catalogues[7].splits, strict=True):
        assert len(a) == len(b)
        shared = np.intersect1d(set_ids(a), set_ids(b))
        assert len(shared) < 0.6 * len(a), "a third by chance"


@pytest.mark.parametrize(
    ("settings", "kind"),
    [
        ({"cubes": (3, 3)}, "other"),
        ({"cubes": (4, 4)}, "other"),
        ({"cubes": (4, 4), "shapes": "tree", "distractors": "near"}, "near"),
        ({"cubes": (5, 5)}, "near"),
        ({"cubes": (5, 5), "distractors": "mirror"}, "mirror"),
        ({"cubes": (8, 8), "max_radius": 1.5, "min_cube_pixels": 1}, "other"),
    ],
)
def test_too_few_shapes_are_told_before_anything_is_rendered(settings, kind, monkeypatch):
    monkeypatch.setattr("scenegen.rendering.renderer.launch_fields", None)
    spec = SplitSpec(**settings)
    low, high = spec.cubes
    with pytest.raises(TooFewShapesError) as error:
        make_pools(spec)
    assert str(error.value) == (
        f"cubes: {spec.shapes} shapes of {low}-{high} cubes within radius {spec.max_radius:g} are"
        f" too few for {kind!r} questions of their own in each of train, val, test;"
        " take more --cubes, or a larger --max-radius"
    )


def test_a_request_that_does_not_tell_its_seed_is_refused():
    with pytest.raises(SpecError, match="seed: found none, as in files that do not tell it"):
        make_pools(SPEC.public())


def test_sizes_that_do_not_allow_a_kind_are_left_out_of_it_alone():
    sizes = make_pools(replace(SPEC, seed=0, cubes=(3, 7))).sizes
    assert sizes == {"other": (5, 6, 7), "near": (6, 7), "mirror": (6, 7)}
    alone = replace(SPEC, cubes=(5, 5), distractors="other")
    assert len(draw_shapes(alone, make_pools(alone), "train", [(0, 0), (1, 0)])) == 2


def test_where_few_shapes_of_many_cubes_are_found_those_are_shared_out(monkeypatch):
    monkeypatch.setattr(questions, "DRAWN_CLASSES", 4000)
    spec = replace(SPEC, cubes=(12, 12), max_radius=2.5)
    pools = make_pools(spec)
    assert [len(split) for split in pools.catalogues[12].splits] == [40] * 3
    for shapes, _ in draw_shapes(spec, pools, "val", [(i, 0) for i in range(6)]):
        assert (bounding_radius(shapes) <= 2.5).all()
