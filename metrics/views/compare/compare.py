"""Paired comparison of score files over the same images or questions.

Each file is compared with the first one, the reference. Comparing all pairs would test more than
the usual question, whether one method differs from each of some others, and the correction for the
number of tests would hide differences that are there. To compare with another reference, put it
first.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from metrics.measures.alignment import Alignment
from metrics.measures.statistics import (
    RESAMPLES,
    bootstrap_interval,
    cluster_means,
    linearised_means,
)
from metrics.scoring.aligned import aligned, left_out
from metrics.scoring.estimates import pooled_means_of
from metrics.scoring.metric_names import metric
from metrics.scoring.records import ScoreFile
from metrics.views.compare.paired_tests import (
    SIGN_FLIPS,
    holm,
    mcnemar_exact,
    sign_flip_test,
    smallest_detectable_difference,
    smallest_significant_fraction,
)
from metrics.views.compare.pairing import common_rows, pair, require_same_test
from metrics.views.score_tables import labels_of
from scenegen.common.text_table import plain

Array = NDArray[np.float64]
ALPHA, POWER, CONFIDENCE = 0.05, 0.8, 0.95
MCNEMAR, SIGN_FLIP = "exact McNemar", "sign flips"


@dataclass(frozen=True)
class Difference:
    """One score of a method against that of the reference.

    Attributes:
        value, reference_value: means over the rows that are compared, in the score's unit.
        difference: value - reference_value.
        low, high: its 95% interval, not corrected for the number of comparisons; None for a single
            scene or question.
        test: "exact McNemar" or "sign flips".
        p_value: two-sided.
        p_holm: corrected for all comparisons of the family.
        wins, losses, ties: scenes (or questions) in which the method is better, worse, the same.
            Scenes that have no such score, as no picture shows an object, are not among them.
        smallest: minimum detectable difference at 80% power; None if undefined.
    """

    metric: str
    method: str
    value: float
    reference_value: float
    difference: float
    low: float | None
    high: float | None
    test: str
    p_value: float
    p_holm: float
    wins: int
    losses: int
    ties: int
    smallest: float | None

    @property
    def verdict(self) -> str:
        """Whether a difference is shown at 5% after correction: "better", "worse", "not shown"."""
        if self.p_holm > ALPHA or self.difference == 0.0:
            return "not shown"
        higher = metric(self.metric).higher_is_better
        return "better" if (self.difference > 0.0) == higher else "worse"


@dataclass(frozen=True)
class Comparison:
    """Methods against the first of them.

    Attributes:
        reference: name of the first file's method.
        methods: names of the others; equal names are made distinct.
        items, clusters: how many images and scenes were compared; for questions both are their
            number.
        differences: one for each score and method, ordered by score, then by method.
        comparable: False where a file says that it is not, and was compared all the same.
        alignment: after which all methods are scored.
        seed, resamples: of the bootstrap; the seed is that of random sign flips, too.
    """

    task: str
    truth_fingerprint: str
    truth_digest: str
    reference: str
    methods: tuple[str, ...]
    items: int
    clusters: int
    differences: tuple[Difference, ...]
    comparable: bool
    notes: tuple[str, ...]
    alignment: Alignment
    seed: int
    resamples: int


def compare(
    files: Sequence[ScoreFile],
    metrics: Sequence[str] | None = None,
    *,
    seed: int = 0,
    resamples: int = RESAMPLES,
    allow_incomparable: bool = False,
    align: Alignment | None = None,
) -> Comparison:
    """Compare the scores of each file with those of the first, all under one alignment.

    Args:
        files: two or more, of one test set.
        metrics: the scores to compare; None means `metric_names.HEADLINE` of the task. Holm's
            correction is for the number of these scores times that of the later files.
        seed, resamples: of the bootstrap; the seed is that of random sign flips, too.
        allow_incomparable: compare files that say that they are not comparable, over the rows that
            all of them hold.
        align: the alignment of all; None for the loosest one that a method declares.

    Raises OtherTruthError and ComparisonError where the files do not belong together,
    AlignmentError where no alignment brings them together, and UnknownMetricError.
    """
    require_same_test(files, metrics, allow_incomparable)
    as_scored, files = files, aligned(files, align)
    names = require_same_test(files, metrics, allow_incomparable)
    orders = common_rows(files)
    clusters = files[0].clusters[orders[0]]
    labels = labels_of(files)
    pairs = [(name, i) for name in names for i in range(1, len(files))]

    def difference(name: str, i: int) -> Difference:
        paired = _paired(files[i], files[0], name, (orders[i], orders[0]))
        a, b, apart = paired.values, paired.reference_values, paired.apart
        low, high = _interval(paired.means, seed, resamples)
        better = apart if metric(name).higher_is_better else -apart
        exact = files[0].task == "iqtt" and files[i].runs == files[0].runs == 1
        exact = exact and len(paired.means) == len(apart)
        p_value = mcnemar_exact(a == 1.0, b == 1.0) if exact else sign_flip_test(paired.sums, seed)
        return Difference(
            metric=name,
            method=labels[i],
            value=paired.value,
            reference_value=paired.reference_value,
            difference=float(apart.mean()),
            low=low,
            high=high,
            test=MCNEMAR if exact else SIGN_FLIP,
            p_value=p_value,
            p_holm=p_value,
            wins=int(np.count_nonzero(better > 0.0)),
            losses=int(np.count_nonzero(better < 0.0)),
            ties=int(np.count_nonzero(better == 0.0)),
            smallest=_smallest(paired.means, exact, ALPHA / len(pairs)),
        )

    differences = [difference(name, i) for name, i in pairs]
    adjusted = holm([d.p_value for d in differences]).tolist()
    count = len(np.unique(clusters))
    return Comparison(
        task=files[0].task,
        truth_fingerprint=files[0].meta.truth_fingerprint,
        truth_digest=files[0].meta.truth_digest,
        reference=labels[0],
        methods=tuple(labels[1:]),
        items=len(clusters),
        clusters=count,
        differences=tuple(replace(d, p_holm=p) for d, p in zip(differences, adjusted, strict=True)),
        comparable=all(file.comparable for file in files),
        notes=(
            *left_out(as_scored, names),
            *_notes(files, labels, len(clusters), count, len(pairs)),
        ),
        alignment=files[0].alignment,
        seed=seed,
        resamples=resamples,
    )


def difference_interval(
    file: ScoreFile, reference: ScoreFile, name: str
) -> tuple[float | None, float | None]:
    """Return the interval of a paired difference in a score, as `Difference` has it.

    Raises ComparisonError as `compare` for two files of one test set.
    """
    of_reference, order = common_rows([reference, file])
    paired = _paired(file, reference, name, (order, of_reference))
    return _interval(paired.means, 0, RESAMPLES)


class _Paired(NamedTuple):
    """A score of a method and of the reference, over the M rows that have it.

    Attributes:
        values, reference_values: of each row, (M,).
        value, reference_value: their means, as score files have them.
        apart: differences of scenes, or of questions, (S,).
        means, sums: differences of what is independent, for intervals and for tests: of scenes, or
            of shapes that are asked about.
    """

    values: Array
    reference_values: Array
    value: float
    reference_value: float
    apart: Array
    means: Array
    sums: Array


def _paired(
    file: ScoreFile, reference: ScoreFile, name: str, orders: tuple[NDArray[np.int64], ...]
) -> _Paired:
    """Return a score of two files; `orders` are from `common_rows`. Raises as `pair`."""
    a, b, there = pair(file, reference, name, orders)
    clusters = reference.clusters[orders[1]][there]
    weights = reference.weights
    if weights is not None:
        weight = weights[orders[1]][there]
        ours, theirs = (pooled_means_of(name, v, clusters, weight) for v in (a, b))
        apart = ours - theirs
        value, reference_value = float(ours.mean()), float(theirs.mean())
        return _Paired(a, b, value, reference_value, apart, apart, apart)
    apart = cluster_means(a - b, clusters)
    x, y = (float(cluster_means(values, clusters).mean()) for values in (a, b))
    if reference.task == "rooms":
        return _Paired(a, b, x, y, apart, apart, apart)
    shapes = reference.items.get("shape", reference.ids)[orders[1]][there]
    index = np.unique(shapes, return_inverse=True)[1]
    sums = np.bincount(index, apart).astype(np.float64)
    return _Paired(a, b, x, y, apart, linearised_means(apart, shapes)[:, 0], sums)


def _interval(means: Array, seed: int, resamples: int) -> tuple[float | None, float | None]:
    low, high = bootstrap_interval(means[:, None], seed, resamples, CONFIDENCE)
    return (None, None) if math.isnan(low[0]) else (float(low[0]), float(high[0]))


def _smallest(apart: Array, exact: bool, alpha: float) -> float | None:
    """The least difference found with 80% power at alpha, the strictest level of Holm's steps.

    It is at least what the test can call significant at all; None where nothing is.
    """
    count = len(apart)
    if count < 2:
        return None
    smallest = smallest_detectable_difference(apart, alpha, POWER)
    if exact:
        smallest = max(smallest, smallest_significant_fraction(count, alpha))
        return smallest if smallest <= 1.0 else None
    return smallest if smallest > 0.0 and least_p_value(count) <= alpha else None


def least_p_value(clusters: int) -> float:
    """The least p-value that the sign-flip test of so many scenes can give."""
    return max(2.0 ** (1 - clusters), 1.0 / (SIGN_FLIPS + 1))


def _notes(
    files: Sequence[ScoreFile], labels: Sequence[str], items: int, clusters: int, tests: int
) -> Iterator[str]:
    seen: dict[str, str] = {}
    for file, label in zip(files, labels, strict=True):
        if not file.comparable:
            why = "; ".join(map(plain, file.warnings))
            yield f"{label}: {why or 'not comparable'}"
        if file.runs > 1:
            yield (
                f"{label}: mean of {file.runs} training runs; the tests hold for these runs, not"
                " for training in general"
            )
        if file.declared is not None:
            yield f"{label}: declared alignment {file.declared}, scored after {file.alignment}"
        for submission in file.meta.submissions:
            if seen.setdefault(submission.sha256, label) != label:
                yield f"{label} and {seen[submission.sha256]} are scores of the same predictions"
    if not all(file.comparable for file in files):
        unit = "questions" if files[0].task == "iqtt" else "images"
        yield f"compared over the {items} {unit} that all files score"
    least = min(1.0, least_p_value(clusters) * tests)
    if files[0].task != "iqtt" and least > ALPHA:
        counted = f"{clusters} {files[0].unit}" + f" and {tests} comparisons" * (tests > 1)
        yield f"no verdict is possible with {counted}: p (Holm) is at least {least:.3g}"
