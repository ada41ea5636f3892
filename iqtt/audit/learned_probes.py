"""Small classifiers that look for the right answer among answers alone, cross-validated.

Each scores every answer by what it is and by how it stands to the other two; the answer of a
question with the highest score is chosen. A question is never scored by a classifier that saw it.
As classifiers share most of what they learned from, their counts vary a fifth more on noise than
those of independent guesses.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
FOLDS = 5
LEAST_QUESTIONS = 50  # fewer say nothing
COMPONENTS = 24  # of thumbnails, that classifiers see


def choose(features: Array, right: Array) -> Array:
    """Return which answer a boosted forest prefers in each question, (N,).

    The same input gives the same output: there is no random choice, and one thread.

    Args:
        features: of the answers, (N, 3, D).
        right: which of them is right, (N,).
    """
    from sklearn.ensemble import HistGradientBoostingClassifier

    seen = _among_others(features.astype(np.float32))
    is_right = np.arange(3) == right[:, None]
    fold = np.arange(len(right)) % FOLDS
    chosen = np.zeros(len(right), np.int64)
    with _one_thread():
        for k in range(FOLDS):
            forest = HistGradientBoostingClassifier(
                max_iter=60,
                max_leaf_nodes=8,
                min_samples_leaf=20,
                l2_regularization=1.0,
                early_stopping=False,
                random_state=0,
            )
            known, asked = fold != k, fold == k
            forest.fit(seen[known].reshape(-1, seen.shape[2]), is_right[known].reshape(-1))
            score = forest.predict_proba(seen[asked].reshape(-1, seen.shape[2]))[:, 1]
            chosen[asked] = score.reshape(-1, 3).argmax(axis=1)
    return chosen


def components(thumbnails: Array) -> Array:
    """Return the images' principal components, (N, 3, P) to (N, 3, at most COMPONENTS)."""
    flat = thumbnails.reshape(-1, thumbnails.shape[2]).astype(np.float64)
    flat = flat - flat.mean(axis=0)
    with _one_thread():
        _, axes = np.linalg.eigh(flat.T @ flat)
        found = flat @ axes[:, ::-1][:, :COMPONENTS]
    return np.asarray(found.reshape(*thumbnails.shape[:2], -1))


def places(answers: Array, context: Array) -> Array:
    """Return the commonest right answer in the same context, learned from other questions, (Q,).

    Args:
        answers: (Q,).
        context: small whole numbers, (Q,).
    """
    fold = np.arange(len(answers)) % FOLDS
    counts = np.zeros((FOLDS, context.max(initial=0) + 1, 3), np.int64)
    np.add.at(counts, (fold, context, answers), 1)
    learned = (counts.sum(axis=0) - counts).argmax(axis=2)
    return np.asarray(learned[fold, context])


def _among_others(features: Array) -> Array:
    """Return each answer's features, less the others' mean, their distance, and the others' own."""
    second, third = (np.roll(features, -k, axis=1) for k in (1, 2))
    apart = np.abs(features - second) + np.abs(features - third)
    return np.concatenate(
        [features, features - (second + third) / 2, apart, np.abs(second - third)], axis=2
    )


@contextmanager
def _one_thread() -> Iterator[None]:
    """Sums then have one order, so the same input gives the same bits."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        yield
