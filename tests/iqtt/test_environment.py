"""Questions one at a time: the same again, right, of training shapes, as asked."""

import numpy as np
import pytest

from iqtt.environment import Questions, difficulty_of, question
from iqtt.shapes.polycube import canonical, canonical_class
from iqtt.shapes.splits import split_of
from iqtt.vlm.reading import LETTERS
from scenegen.common.errors import SceneGenError

SMALL = {"cubes": (6, 7), "size": 64}


@pytest.mark.parametrize(
    ("kind", "cubes"), [("matched", 10), ("mirror-pair", (6, 7)), ("near", 7), ("other", (5, 9))]
)
def test_questions_are_right_repeatable_and_never_of_test_shapes(kind, cubes):
    letters = set()
    for index in range(6):
        made, again = (question(3, index, kind=kind, cubes=cubes, size=64) for _ in range(2))
        assert np.array_equal(again.pictures, made.pictures)
        shapes = made.question.shapes.cubes
        ids = canonical(shapes)
        same = [np.array_equal(ids[0], other) for other in ids[1:]]
        assert [LETTERS[k] for k, is_same in enumerate(same) if is_same] == [made.answer]
        assert made.verify(f"The answer is {made.answer}.") == 1
        assert sum(made.verify(letter) for letter in "ABC") == 1
        assert (split_of(canonical_class(shapes)) == 0).all()
        assert made.image.shape[2] == 3
        letters.add(made.answer)
    assert len(letters) > 1


def test_angles_and_cubes_are_as_asked():
    for index in range(3):
        made = question(0, index, kind="other", cubes=5, angle=(60.0, 110.0), size=64)
        assert (made.cubes, made.kind) == (5, "other")
        assert 60 <= made.angle_degrees <= 110
    assert difficulty_of("other", 3, 0) == 0
    assert difficulty_of("matched", 11, 180) == 1


def test_entries_score_letters():
    entries = Questions(3, seed=1, kind="other", **SMALL)
    assert len(list(entries)) == 3
    assert entries[-1]["metadata"]["index"] == 2
    entry = entries[0]
    assert entries.score_answer(f"**{entry['answer']}**", entry) == 1.0
    assert entries.score_answer("A or B", entry) == 0.0
    assert entries.score_answer(None, entry) == 0.0


@pytest.mark.parametrize(
    "settings",
    [{"kind": "nonsense"}, {"cubes": 2}, {"angle": (90, 20)}, {"size": 1}, {"answers": 5}],
)
def test_what_cannot_be_asked_is_refused(settings):
    with pytest.raises(SceneGenError):
        question(0, 0, **settings)
