"""Answers of models as they come: the letter, no letter, or several."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from iqtt.vlm.reading import LETTERS, Reading, read_answer

A, B, C, NONE, REFUSED = "A", "B", "C", "unparsed", "refused"
FORMS = [
    ("B", B), ("b", B), ("B.", B), ("(B)", B), ("[B]", B), ("B)", B), ("**B**", B), ("*B*", B),
    ("`C`", C), ('"A"', A), ("A\n", A), (" C ", C), ("Picture B", B), ("picture b.", B),
    ("Option C", C), ("Image A", A), ("Answer: B", B), ("ANSWER: C", C), ("Answer - A", A),
    ("**Answer:** B", B), ("**Answer: B**", B), ("The answer is B.", B),
    ("The answer is picture C.", C), ("The correct answer is (A).", A),
    ("The correct option is B", B), ("the final answer is **C**", C), ("Final answer: A", A),
    (r"\boxed{A}", A), (r"$\boxed{\text{B}}$", B), (r"The answer is $\boxed{C}$.", C),
    (r"So $\boxed{A}$? No: $\boxed{B}$", B), (r"\boxed{\text{Picture B}}", B),
    ("I choose B because its arm turns left.", B), ("I would pick picture A.", A),
    ("I'll go with C.", C), ("It is picture B.", B), ("It's A.", A),
    ("B) It has the same arms.", B), ("C. The shape is turned by 90 degrees.", C),
    ("A: same chain of cubes", A), ("Picture C shows the same shape as the reference.", C),
    ("B is the correct answer.", B), ("Picture A matches the reference.", A),
    ("Picture A is a mirror image. Picture C is not the same. The answer is B.", B),
    ("At first I thought the answer is A, but the answer is C.", C),
    ("<think>The answer is A.</think>B", B), ("<think>A or B?</think>\n\nThe answer is C.", C),
    ("The reference has a long arm.\n\nB", B), ("Let me compare.\n...\n**C**", C),
    ('{"answer": "B"}', B), ('```json\n{"answer": "C"}\n```', C), ("Only picture B fits.", B),
    ("A or B", NONE), ("A and C", NONE), ("A/B", NONE), ("The answer is A or B.", NONE),
    ("The answer is either A or C", NONE), ("Picture A and picture B both match.", NONE),
    ("", NONE), ("The shape has 9 cubes.", NONE), ("D", NONE), ("The answer is D.", NONE),
    ("A cube sticks out of a long chain.", NONE), ("1", NONE), ("None of them.", NONE),
    ("<think>The answer is A", NONE), ("I cannot see any image.", REFUSED),
    ("I'm sorry, but I can't help with that.", REFUSED), ("As an AI I cannot view it.", REFUSED),
]  # fmt: skip


@pytest.mark.parametrize(("text", "expected"), FORMS)
def test_forms_of_answers_that_models_give(text: str, expected: str) -> None:
    reading = read_answer(text)
    if expected in LETTERS:
        assert reading == Reading(LETTERS.index(expected), "answered")
    else:
        assert reading == Reading(None, expected)


@given(st.text(max_size=200), st.integers(1, 4))
def test_any_text_has_a_reading_within_the_letters_offered(text: str, answers: int) -> None:
    reading = read_answer(text, answers)
    assert (reading.answer is not None) == (reading.outcome == "answered")
    assert reading.answer is None or 0 <= reading.answer < answers
