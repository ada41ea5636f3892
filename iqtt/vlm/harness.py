"""Scores of answered rows as harnesses want them: dicts of one row each, and means over them.

A row is a dict with `question_index`, `rotation`, `shape`, `floor`, `score` (0 or 1) and `outcome`.
"""

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

from iqtt.vlm.reading import LETTERS, Outcome, read_reply

Answered = Mapping[str, Any]


def answered(row: Mapping[str, Any], text: str, outcome: Outcome | None = None) -> dict[str, Any]:
    """Return how a model's text answers a row of `questions.parquet`.

    Args:
        outcome: "refused" or "cut off" where the harness tells that.
    """
    reading = read_reply(text, len(row["choices"]), outcome)
    letter = None if reading.answer is None else LETTERS[reading.answer]
    kept = ("question_index", "rotation", "kind", "shape", "floor")
    return {
        **{name: row[name] for name in kept},
        "choices": list(row["choices"]),
        "digest": row["digest"],
        "letter": letter,
        "outcome": reading.outcome,
        "score": float(letter == row["answer"]),
    }


def accuracy(rows: Sequence[Answered]) -> float:
    """Return the share of right rows."""
    return float(sum(row["score"] for row in rows) / len(rows))


def circular_accuracy(rows: Sequence[Answered]) -> float:
    """Return the share of questions whose every rotation is answered rightly."""
    worst: dict[int, float] = defaultdict(lambda: 1.0)
    for row in rows:
        worst[row["question_index"]] = min(worst[row["question_index"]], row["score"])
    return sum(worst.values()) / len(worst)


def skill(rows: Sequence[Answered]) -> float:
    """Return how much of the way from the floor to perfect the accuracy has gone.

    NaN where the floor of some kind of question is not known.
    """
    floors = [math.nan if row["floor"] is None else row["floor"] for row in rows]
    floor = sum(floors) / len(rows)
    return float((accuracy(rows) - floor) / (1 - floor))


def unparsed(rows: Sequence[Answered]) -> float:
    """Return the share of rows without a letter."""
    return float(sum(row["letter"] is None for row in rows) / len(rows))


def doc_to_visual(doc: Mapping[str, Any]) -> list[Any]:
    """Return the pictures of a row, as PIL images: one, or the reference and the answers."""
    separate = "The first picture is the reference." in doc["question"]
    pictures = doc["images"] if separate else [doc["image"]]
    return [picture.convert("RGB") for picture in pictures]


def doc_to_text(doc: Mapping[str, Any], lmms_eval_specific_kwargs: Any = None) -> str:
    """Return the text of a row, between the texts that a model's settings put around it."""
    around = lmms_eval_specific_kwargs or {}
    return f"{around.get('pre_prompt', '')}{doc['question']}{around.get('post_prompt', '')}"


def process_results(doc: Mapping[str, Any], results: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the answered row under the name of each metric."""
    row = answered(doc, results[0])
    return dict.fromkeys(("accuracy", "circular_accuracy", "skill", "unparsed"), row)
