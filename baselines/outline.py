"""Answers by outlines: the nearest one, without any label, or what trees learn from labels.

Both see the silhouettes of `iqtt.audit.features.outlines` and nothing else, so they know neither
cubes nor rotations. The audit's probes see the same; `iqtt floors` measures what they reach.
"""

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit.features.outlines import nearest_outline, outlines
from iqtt.audit.features.statistics import border_color, silhouettes
from iqtt.audit.probes.trees import AnswerTrees, next_to_reference
from iqtt.files.reader import QuestionsFile, open_questions, parts
from metrics.prediction_writer import write_answers
from scenegen.common.errors import SpecError
from scenegen.common.records import check
from scenegen.common.threads import one_thread

Array = NDArray[Any]
Progress = Callable[[int, int], Any]  # questions done since the last call, in all
CHUNK = 64  # questions in memory at once
ENSEMBLE = 3  # sets of trees
Outlines = tuple[Array, Array]  # features and distances, as `iqtt.audit.features.outlines` has them


@one_thread()
def write_outline(
    data: str | Path,
    out: str | Path,
    train: str | Path | None = None,
    labels: int | None = None,
    *,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Answer the questions of a file by the nearest outline, or by trees. Deterministic.

    Args:
        train: a file with labelled questions of as many answers, such as iqtt-train.h5, from which
            the trees learn; without it no label is used.
        labels: how many of its labelled questions to learn from, the first ones; all by default.

    Raises SpecError as `check_training`; else as `open_questions` and `write_answers`.
    """
    with ExitStack() as stack:
        questions = stack.enter_context(open_questions(data))
        if train is not None:
            labelled = stack.enter_context(open_labelled(train))
            count = check_training(questions, labelled, labels)
            learned = read_outlines(labelled, count, progress)
            right = labelled.read("answers", slice(0, count)).astype(np.int64)
        seen = read_outlines(questions, len(questions), progress)
    method, notes, scores = "outline", "", nearest_scores(seen)
    if train is not None:
        method, notes = "outline-trees", f"{count} labels of {train}"
        scores = tree_scores(learned, right, seen)
    write_answers(out, data, method=method, scores=scores, notes=notes, overwrite=overwrite)


def read_outlines(
    questions: QuestionsFile, count: int, progress: Progress = lambda done, total: None
) -> Outlines:
    """Return the outlines of the first questions of a file, Q of them with K answers each.

    That are features of each image, (Q, 1 + K, D), and distances between any two images of a
    question, (Q, 1 + K, 1 + K, P).

    Args:
        progress: called with the questions read since the last call, and the questions in all.

    Raises FileFormatError where the file is damaged.
    """
    parts = []
    background = border_color(questions.read("questions", slice(0, min(count, CHUNK))))
    for start in range(0, max(count, 1), CHUNK):
        images = questions.read("questions", slice(start, min(start + CHUNK, count)))
        parts.append(outlines(silhouettes(images, background)))
        progress(len(images), count)
    features, distances = map(np.concatenate, zip(*parts, strict=True))
    return features, distances


def nearest_scores(seen: Outlines) -> Array:
    """Return a score of each answer, (Q, K): the nearer its outline, the higher."""
    return -nearest_outline(seen[1])[:, 0, 1:].astype(np.float64)


def tree_scores(learned: Outlines, right: Array, seen: Outlines) -> Array:
    """Return a score of each answer of the questions that are seen, (Q, K), by what was learned.

    Args:
        right: the right answers of the questions to learn from, (N,).
    """
    columns, questions = (
        next_to_reference(features, distances[:, 0, 1:]) for features, distances in (learned, seen)
    )
    return AnswerTrees(ENSEMBLE).fit(columns, right).scores(questions)


def open_labelled(train: str | Path) -> QuestionsFile:
    """Open the questions of a training file that baselines may learn from."""
    names = parts(train)
    return open_questions(train, "labeled" if "labeled" in names else names[0])


def check_training(
    questions: QuestionsFile, labelled: QuestionsFile, labels: int | None, least: int = 1
) -> int:
    """Return how many labelled questions to learn from, all where `labels` is None.

    Raises SpecError where there are fewer than `least` or `labels`, or no answers, where the file
    is the one to answer, and where it asks questions with another number of answers.
    """
    count, path = len(labelled), labelled.path
    check(labelled.has_answers and count > 0, "train", path, "a file with labels")
    chosen = count if labels is None else labels
    expected = f"from {least} to {count:,}, the labelled questions of {path}"
    check(least <= chosen <= count, "labels", chosen, expected)
    same = labelled.fingerprint is not None and labelled.fingerprint == questions.fingerprint
    if same or path.samefile(questions.path):
        raise SpecError("train", path, "another file than --data")
    answers, expected = labelled.answers, f"{questions.answers}"
    check(
        labelled.answers == questions.answers, "train", f"{answers} options per question", expected
    )
    return chosen
