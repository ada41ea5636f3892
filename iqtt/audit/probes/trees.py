"""Gradient-boosted trees that choose one of a question's answers, by numbers that describe images.

Each answer gets a score from its own numbers and from how they stand to those of the other answers,
and, in `next_to_reference`, to those of the reference; the answer of the highest score is chosen.
So the trees are the same for all places of an answer, and for any number of answers. The same
input gives the same bits: random choices have a fixed seed, and sums one thread.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.threads import one_thread

Array = NDArray[Any]
FOLDS = 5  # of the cross-validation


class AnswerTrees:
    """Trees that score the answers of questions (scikit-learn's HistGradientBoosting)."""

    def __init__(self, ensemble: int = 1) -> None:
        """Choose how many sets of trees to learn, each with other random choices of columns."""
        self._ensemble = ensemble
        self._trees: list[Any] = []

    def fit(self, columns: Array, right: Array) -> "AnswerTrees":
        """Learn from questions; the more there are, the larger are the trees.

        Args:
            columns: numbers of each answer, (N, K, D), as `among_others` or `next_to_reference`
                give them.
            right: which answer is right, (N,).
        """
        from sklearn.ensemble import HistGradientBoostingClassifier

        count, answers, width = columns.shape
        is_right = np.arange(answers) == right[:, None]
        with one_thread():
            self._trees = [
                HistGradientBoostingClassifier(
                    learning_rate=0.05,
                    max_iter=int(np.interp(count, (200, 1000, 5000), (60, 100, 200))),
                    max_leaf_nodes=int(np.interp(count, (200, 1000, 5000), (4, 8, 12))),
                    max_features=0.3,
                    max_bins=64,
                    min_samples_leaf=20,
                    l2_regularization=5.0,
                    early_stopping=False,
                    random_state=seed,
                ).fit(columns.reshape(-1, width), is_right.reshape(-1))
                for seed in range(self._ensemble)
            ]
        return self

    def scores(self, columns: Array) -> Array:
        """Return the score of each answer, (N, K); the highest is the trees' choice."""
        flat = columns.reshape(-1, columns.shape[2])
        with one_thread():
            total = sum(trees.decision_function(flat) for trees in self._trees)
        return np.asarray(total).reshape(columns.shape[:2])


def choose(columns: Array, right: Array) -> Array:
    """Return which answer trees prefer in each question, cross-validated by question, (N,)."""
    fold = np.arange(len(right)) % FOLDS
    chosen = np.zeros(len(right), np.int64)
    for k in range(FOLDS):
        learned, answered = fold != k, fold == k
        trees = AnswerTrees().fit(columns[learned], right[learned])
        chosen[answered] = trees.scores(columns[answered]).argmax(axis=1)
    return chosen


def among_others(features: Array) -> Array:
    """Return each answer's features, and how they stand to the others', (N, K, 4 D).

    Args:
        features: (N, K, D).
    """
    wide = features.astype(np.float32)
    count = wide.shape[1]
    others = (wide.sum(axis=1, keepdims=True) - wide) / (count - 1)
    apart = sum(np.abs(wide - np.roll(wide, -k, axis=1)) for k in range(1, count))
    spread = np.sqrt(np.maximum(_mean_of_others(wide**2) - others**2, 0))
    return np.concatenate([wide, wide - others, apart, spread], axis=2)


def next_to_reference(features: Array, distances: Array) -> Array:
    """Return how each answer stands to the reference, and how the others do, (N, K, 3 D + 2 P + 2).

    Args:
        features: of the reference and the answers, (N, 1 + K, D).
        distances: from the reference to the answers, (N, K, P), of other kinds.
    """
    wide = features.astype(np.float32)
    reference, answers = wide[:, :1], wide[:, 1:]
    apart = np.abs(answers - reference)
    unit = np.maximum(wide.std(axis=(0, 1)), 1e-6)
    far = np.sqrt(((apart / unit) ** 2).sum(axis=2, keepdims=True))
    both = np.concatenate([apart, distances, far], axis=2).astype(np.float32)
    return np.concatenate([both, answers + reference, both - _least_of_others(both)], axis=2)


def _mean_of_others(values: Array) -> Array:
    count = values.shape[1]
    return np.asarray((values.sum(axis=1, keepdims=True) - values) / (count - 1))


def _least_of_others(values: Array) -> Array:
    """Return for each answer the least value of the others, (N, K, D)."""
    order = np.sort(values, axis=1)
    return np.where(values == order[:, :1], order[:, 1:2], order[:, :1])
