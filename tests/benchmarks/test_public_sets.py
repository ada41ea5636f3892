"""Questions of public generators are as the audit reads them, and have the shapes of their sets."""

import json

import pytest

from benchmarks.public_sets import SETS, questions
from iqtt.audit.strangers import audit_strangers


@pytest.mark.parametrize("name", SETS)
def test_questions_are_audited_and_their_keys_are_right(name, tmp_path):
    made = questions(name, 4, seed=1)
    (tmp_path / "shapes.json").write_text(json.dumps(made))
    audit = audit_strangers(tmp_path / "shapes.json", lambda done: None)
    assert (audit["counts"]["no correct option"], audit["counts"]["wrong key"]) == (0, 0)
    if name in ("spatialbench", "spatialviz"):
        sizes = [{len(a["cubes"]) for a in q["answers"]} for q in made["questions"]]
        assert all(s == {10} if name == "spatialbench" else max(s) <= 10 for s in sizes)
