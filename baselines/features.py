"""Answers by features of a frozen encoder, anyone's: the nearest one, or a probe of labels.

The encoder runs elsewhere. Its features come as .npy files of (Q, 1 + K, D) numbers, the reference
first, in the order of the file's questions.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.outline import check_training, open_labelled
from iqtt.files.reader import QuestionsFile, open_questions
from metrics.intake.array_files import read_array
from metrics.prediction_writer import write_answers
from scenegen.common.errors import FileFormatError
from scenegen.common.records import check
from scenegen.files.new_file import check_writable

Array = NDArray[Any]
FOLDS = 5  # of the choice of how strongly weights are held near 0
STRENGTHS = (1e-3, 1e-2, 1e-1, 1.0, 10.0)


def write_features(
    data: str | Path,
    out: str | Path,
    features: str | Path,
    *,
    train: str | Path | None = None,
    train_features: str | Path | None = None,
    labels: int | None = None,
    overwrite: bool = False,
) -> None:
    """Answer the questions of a file by features of their pictures.

    Without labels the answer of the greatest cosine with the reference wins. With labels a Siamese
    probe weighs the squared differences of each dimension by logistic regression.

    Args:
        features: .npy of the questions of `data`; train_features: of the labelled ones of `train`,
            or of its first ones.
        labels: how many of the labelled questions to learn from, the first ones; all by default.

    Raises SpecError as `check_training`, and where features of training are missing or not used;
    FileFormatError where features do not fit or are not finite; else as `open_questions`,
    `read_array` and `write_answers`.
    """
    check_writable(Path(out), overwrite)
    with open_questions(data) as questions:
        seen = read_features(features, len(questions), questions)
    if train is None or train_features is None:
        name, given = ("train_features", train) if train else ("train", train_features)
        check(given is None, name, "none", f"one that belongs to {given}")
        check(labels is None, "labels", labels, "none, as nothing is learned without --train")
        scores, notes = cosines_with_reference(seen), "cosine of features; no labels"
    else:
        with open_labelled(train) as labelled:
            count = check_training(questions, labelled, labels, least=2 * FOLDS)
            learned = read_features(train_features, count, labelled)
            if learned.shape[2] != seen.shape[2]:
                found, expected = (f"{one.shape[2]} numbers a picture" for one in (learned, seen))
                raise FileFormatError(train_features, found, f"{expected}, as {features} has")
            right = labelled.read("answers", slice(0, count)).astype(int)
        scores, notes = probe_scores(learned, right, seen), f"a probe of {count} labels of {train}"
    write_answers(out, data, method="features", scores=scores, notes=notes, overwrite=overwrite)


def read_features(path: str | Path, count: int, questions: QuestionsFile) -> Array:
    """Return the features of the first questions, (count, 1 + K, D) float64 of length 1.

    Raises as `read_array`; FileFormatError where there are none of so many questions, or not finite
    ones.
    """
    values, pictures = read_array(Path(path)), 1 + questions.answers
    expected = f"numbers of the shape ({count}, {pictures}, D)"
    fits = values.ndim == 3 and values.shape[1] == pictures and values.size
    if not fits or not count <= len(values) <= len(questions):
        raise FileFormatError(path, f"the shape {values.shape}", expected)
    if values.dtype.kind not in "fiu":
        raise FileFormatError(path, f"values of {values.dtype}", expected)
    read = np.asarray(values[:count], np.float64)
    if not np.isfinite(read).all():
        row = int(np.flatnonzero(~np.isfinite(read).all(axis=(1, 2)))[0])
        raise FileFormatError(f"{path}: row {row}", "features that are not finite", "numbers")
    return of_length_one(read)


def of_length_one(features: Array) -> Array:
    """Return features (..., D) divided by their lengths, as float64; 0 stays 0."""
    values = np.asarray(features, np.float64)
    for norm in (np.inf, 2):  # the first, so that no square overflows
        length = np.linalg.norm(values, norm, axis=-1, keepdims=True)
        values = values / np.where(length > 0, length, 1)
    return values


def cosines_with_reference(features: Array) -> Array:
    """Return the cosine of each answer with the reference, (Q, K)."""
    cosines: Array = np.einsum("qd,qkd->qk", features[:, 0], features[:, 1:])
    return cosines


def probe_scores(learned: Array, right: Array, seen: Array) -> Array:
    """Return scores of answers, (Q, K), by weights of dimensions that labelled questions teach.

    Args:
        learned, seen: features of length 1, (N, 1 + K, D) and (Q, 1 + K, D).
        right: the right answers of the N questions.
    """
    from sklearn.linear_model import LogisticRegression
    from sklearn.model_selection import GroupKFold, cross_val_score

    columns, asked = (np.square(f[:, 1:] - f[:, :1]) for f in (learned, seen))
    spread = columns.std(axis=(0, 1))
    scale = np.where(spread > 0, spread, 1)
    count, answers, width = columns.shape
    flat = (columns / scale).reshape(-1, width)
    is_right = (np.arange(answers) == right[:, None]).reshape(-1)
    folds = list(GroupKFold(FOLDS).split(flat, groups=np.repeat(np.arange(count), answers)))
    probes = [LogisticRegression(C=strength, max_iter=1000) for strength in STRENGTHS]
    merits = [
        cross_val_score(probe, flat, is_right, cv=folds, scoring="neg_log_loss").mean()
        for probe in probes
    ]
    weights = probes[int(np.argmax(merits))].fit(flat, is_right).coef_[0] / scale
    return np.asarray(asked @ weights)
