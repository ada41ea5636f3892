"""Questions of public generators are as the audit reads them, and have the shapes of their sets."""

import json

import numpy as np
import pytest

from benchmarks.public_sets import SETS, questions
from iqtt.audit.strangers import audit_strangers


@pytest.mark.parametrize("name", SETS)
def test_questions_are_audited_and_their_keys_are_right(name, tmp_path):
    made = questions(name, 4, seed=1)
    (tmp_path / "shapes.json").write_text(json.dumps(made))
    audit = audit_strangers(tmp_path / "shapes.json", lambda done: None)
    assert (audit["counts"]["no right answer"], audit["counts"]["wrong key"]) == (0, 0)
    if name in ("spatialbench", "spatialviz"):
        sizes = [{len(a["cubes"]) for a in q["answers"]} for q in made["questions"]]
        assert all(s == {10} if name == "spatialbench" else max(s) <= 10 for s in sizes)


def test_a_flipped_picture_is_of_the_mirror_image():
    """A cube's place in the picture of the mirror image is its own place, flipped."""
    for question in questions("spatialviz", 6, seed=0)["questions"]:
        reference, key = question["reference"], question["key"]
        (flipped,) = (
            a
            for k, a in enumerate(question["answers"])
            if k != key and len(a["cubes"]) == len(reference["cubes"])
        )
        own, other = (
            np.array(v["cubes"]) @ np.array(v["rotation"]).T for v in (reference, flipped)
        )
        assert np.allclose(own[:, 2], other[:, 2])
        assert np.allclose(np.abs(own), np.abs(other))
