"""Answers of models as they come: the letter, no letter, or several."""

import json
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from iqtt.vlm.reading import LETTERS, Reading, read_answer

# Kind, what a careful person reads (a letter of A to C, "none" or "refusal"), and the reply. Forms
# are those of the chat templates of open models, and those that parsers of harnesses look for.
LINES = Path(__file__).with_name("replies.jsonl").read_text(encoding="utf-8").splitlines()
REPLIES = [tuple(json.loads(line)) for line in LINES]
A_PLAIN_TEXT = "Picture A shows a chain of cubes, and its arm turns left, but B is "


@pytest.mark.parametrize("kind", sorted({kind for kind, _, _ in REPLIES}))
def test_a_reply_is_read_as_a_careful_person_reads_it(kind):
    expected = {text: read_as for its, read_as, text in REPLIES if its == kind}
    assert {text: shown(read_answer(text)) for text in expected} == expected


def shown(reading):
    """Return a reading as the table of replies has it."""
    if reading.answer is None:
        return {"unparsed": "none", "refused": "refusal"}[reading.outcome]
    return LETTERS[reading.answer]


@pytest.mark.parametrize(
    ("text", "letter"),
    [
        ("B", "B"), ("(B", "B"), ("The answer is B. Its arm turns", "B"),
        ("<answer>B</answer>", "B"),
        ("", ""), ("<think>The answer is A", ""), ("Picture A shows the same", ""),
        ("A is the same shape.", ""), ("B because", ""), ("A: same\nB: ", ""), ("Perhaps A", ""),
    ],
)  # fmt: skip
def test_a_reply_that_was_cut_off_answers_only_by_a_declaration(text, letter):
    answer = LETTERS.index(letter) if letter else None
    assert read_answer(text, cut_off=True) == Reading(answer, "cut off")


@given(st.text(max_size=200) | st.text("ABC<think>/answer:is not\\boxed{}\n", max_size=200),
       st.integers(1, 10))  # fmt: skip
def test_any_text_has_a_reading_within_the_letters_offered(text, answers):
    reading = read_answer(text, answers)
    assert (reading.answer is not None) == (reading.outcome == "answered")
    assert reading.answer is None or 0 <= reading.answer < answers


@pytest.mark.parametrize(
    "part",
    [
        "<think>", "<answer>", "\\boxed{", "{", "A, ", A_PLAIN_TEXT, "[", " ", "<|channel|>",
        "not ", '{"a":', "analysis", "\ud800", "A B ", "\n", "the answer ", "(", "it is ", "A", "<",
        "( ",
    ],
)  # fmt: skip
def test_long_texts_are_read_in_time_that_grows_with_their_length(part):
    started = time.process_time()
    read_answer(part * (20_000 // len(part)))
    assert time.process_time() - started < 2
