"""Questions of other people: each fault is named, and questions of ours have none."""

import json

import numpy as np
import pytest

from iqtt.audit.strangers import RULES, audit_strangers
from iqtt.files.reader import QuestionsFile
from scenegen.common.errors import FileFormatError

L = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 1, 1]]  # chiral
FLAT = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0]]  # its mirror image is itself
TILTED = [[0.8, 0.0, 0.6], [0.36, 0.8, -0.48], [-0.48, 0.6, 0.64]]
OTHER = [[0.0, -1.0, 0.0], [0.6, 0.0, -0.8], [0.8, 0.0, 0.6]]


def mirrored(cubes):
    return [[-x, y, z] for x, y, z in cubes]


def view(cubes, rotation=TILTED):
    return {"cubes": cubes, "rotation": rotation}


def faults(tmp_path, *questions, **more):
    path = tmp_path / "shapes.json"
    path.write_text(json.dumps({"questions": questions, **more}))
    return [set(found) for found in audit_strangers(path, lambda done: None)["faults"]]


GOOD = {"reference": view(L), "answers": [view(L, OTHER), view(mirrored(L), OTHER)], "key": 0}
CASES = [
    (GOOD, set()),
    ({**GOOD, "key": 1}, {"wrong key"}),
    ({**GOOD, "key": 2}, {"wrong key"}),
    ({**GOOD, "answers": GOOD["answers"][1:] * 2}, {"no right answer", "equal pictures"}),
    (
        {"reference": view(FLAT), "answers": [view(FLAT, OTHER), view(mirrored(FLAT), TILTED)]},
        {"more than one right answer"},
    ),
    ({**GOOD, "answers": [view(L, OTHER), view(L[:4], OTHER)]}, {"unlike cube counts"}),
    ({**GOOD, "answers": [view(L, OTHER), view([*L[:4], [5, 5, 5]])]}, {"more than one piece"}),
    (
        {**GOOD, "reference": view(L, np.eye(3).tolist())},
        {"hidden cube"},  # the cube at [2, 1, 0] lies behind that at [2, 1, 1]
    ),
]


@pytest.mark.parametrize(("question", "expected"), CASES)
@pytest.mark.parametrize("more", [{}, {"camera_distance": 40.0}])
def test_each_fault_is_named(tmp_path, question, expected, more):
    assert faults(tmp_path, question, **more) == [expected]
    assert expected <= set(RULES)


def test_questions_of_ours_have_no_fault(split_folder, tmp_path):
    with QuestionsFile(split_folder / "iqtt-val.h5") as file:
        truths = [truth for row in range(len(file)) if (truth := file.truth(row)) is not None]
        answers = [record.answer for record in file]
    for truth, answer in zip(truths, answers, strict=True):
        views = [
            view(cubes.tolist(), rotation.tolist())
            for cubes, rotation in zip(truth.cubes, truth.world_from_shape, strict=True)
        ]
        question = {"reference": views[0], "answers": views[1:], "key": answer}
        distance = float(truth.camera.position[2])
        assert faults(tmp_path, question, camera_distance=distance) == [set()]


@pytest.mark.parametrize(
    "content",
    [
        "nonsense", "[]", "{}", '{"questions": []}', '{"questions": [1]}',
        '{"questions": [{"reference": {}, "answers": []}]}',
        json.dumps({"questions": [{**GOOD, "reference": view([[0, 0]])}]}),
        json.dumps({"questions": [{**GOOD, "reference": view([[0, 0, 0.5]])}]}),
        json.dumps({"questions": [{**GOOD, "reference": view([*L, L[0]])}]}),
        json.dumps({"questions": [{**GOOD, "answers": GOOD["answers"][:1]}]}),
        json.dumps({"questions": [{**GOOD, "reference": view(L, np.diag([1, 1, -1]).tolist())}]}),
        json.dumps({"questions": [GOOD], "camera_distance": 1.0}),
        json.dumps({"questions": [GOOD], "camera_distance": -3}),
    ],
)  # fmt: skip
def test_what_is_no_list_of_questions_is_refused(tmp_path, content):
    path = tmp_path / "shapes.json"
    path.write_text(content)
    with pytest.raises(FileFormatError):
        audit_strangers(path, lambda done: None)
