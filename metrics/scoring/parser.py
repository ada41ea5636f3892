"""The content of a score file, checked: every key, type and limit, and that the numbers agree."""

import re
from collections.abc import Mapping
from typing import Any, cast, get_args

import numpy as np
from numpy.typing import NDArray

from metrics.scoring.metric_names import Metric, UnknownMetricError, metric
from metrics.scoring.records import (
    GROUPINGS,
    ID_COLUMNS,
    OPTIONAL_COLUMNS,
    Groups,
    Meta,
    Score,
    ScoreFile,
    Submission,
    Task,
)
from metrics.submissions.strict_json import LARGEST_WHOLE, Node

FORMAT_NAME = "pix2shape-bench/scores"
FORMAT_VERSION = "1.0"
ALIGNMENTS = ("none", "median_scale", "scale", "scale_shift")
LONGEST_NAME = 200
AGREEMENT = 1e-9  # of a score with the mean of its column, relative
_KEYS = ("format", "format_version", "task", "method", "comparable", "alignment", "metrics")
_META_KEYS = (
    "truth_fingerprint",
    "truth_path",
    "submissions",
    "writer",
    "versions",
    "seed",
    "resamples",
    "confidence",
    "counts",
    "warnings",
)
_GROUP_KEYS = {
    "by_view_angle": (r"[0-9]{1,3}", "whole degrees"),
    "by_distractor": (r"[^\s].{0,59}", "a kind of wrong answer"),
    "by_rotation_angle": (r"[0-9]{1,3}-[0-9]{1,3}", "a range such as 30-60"),
    "by_position": (r"[0-2]", "0, 1 or 2"),
}


def parse_scores(root: Node) -> ScoreFile:
    """Check a whole file. Raises JsonError at the first thing that is wrong."""
    head = dict(root.entries())
    _check_version(root, head)
    task = cast(Task, head["task"].one_of(get_args(Task)) if "task" in head else "rooms")
    found = root.fields((*_KEYS, "items", "meta"), GROUPINGS[task])
    meta = _meta(found["meta"], task)
    items = _items(found["items"], task, len(meta.submissions))
    groups = {
        name: _groups(found[name], task, meta, items) for name in GROUPINGS[task] if name in found
    }
    scores = ScoreFile(
        task=task,
        method=found["method"].text(LONGEST_NAME),
        comparable=found["comparable"].flag(),
        alignment=found["alignment"].one_of(ALIGNMENTS if task == "rooms" else ALIGNMENTS[:1]),
        metrics=_scores(found["metrics"], task, meta, len(items[ID_COLUMNS[task][0]])),
        items=items,
        meta=meta,
        **groups,
        path=root.path,
    )
    if not scores.metrics:
        raise found["metrics"].error("at least one score")
    for name, value in scores.metrics.items():
        _check_agreement(found["metrics"], scores, name, value)
    return scores


def _check_version(root: Node, head: Mapping[str, Node]) -> None:
    for name, expected in (("format", FORMAT_NAME), ("format_version", FORMAT_VERSION)):
        if name not in head:
            raise root.error(f"a file of format {FORMAT_NAME!r}", f"no key {name!r}")
        text = head[name].text()
        if name == "format" and text != expected:
            raise head[name].error(repr(expected))
        if name == "format_version" and not re.fullmatch(r"1\.[0-9]{1,4}", text):
            raise head[name].error("1.x")


def _meta(node: Node, task: str) -> Meta:
    found = node.fields(_META_KEYS, ("chamfer_floor",) if task == "rooms" else ())
    fingerprint = found["truth_fingerprint"].text(LONGEST_NAME)
    if not fingerprint.strip():
        raise found["truth_fingerprint"].error("a text that is not empty")
    confidence = found["confidence"].number(0.0, 1.0)
    if confidence in (0.0, 1.0):
        raise found["confidence"].error("a number between 0 and 1")
    floor = found.get("chamfer_floor")
    return Meta(
        truth_fingerprint=fingerprint,
        truth_path=found["truth_path"].text(),
        submissions=_submissions(found["submissions"]),
        writer=found["writer"].text(),
        versions={name: value.text() for name, value in found["versions"].entries()},
        seed=found["seed"].whole(-LARGEST_WHOLE),
        resamples=found["resamples"].whole(),
        confidence=confidence,
        counts={name: value.whole() for name, value in found["counts"].entries()},
        warnings=tuple(value.text() for value in found["warnings"].members()),
        chamfer_floor=floor.number_or_null(0.0) if floor else None,
    )


def _submissions(node: Node) -> tuple[Submission, ...]:
    submissions: list[Submission] = []
    for member in node.members():
        found = member.fields(("path", "sha256", "run"))
        digest = found["sha256"].text()
        if not re.fullmatch("[0-9a-f]{64}", digest):
            raise found["sha256"].error("64 hexadecimal digits")
        if digest in (other.sha256 for other in submissions):
            raise found["sha256"].error("each submission once", "the same submission twice")
        path, run = found["path"].text(), found["run"].text(LONGEST_NAME)
        submissions.append(Submission(path, digest, run))
    if not submissions:
        raise node.error("at least one submission")
    return tuple(submissions)


def _items(node: Node, task: str, runs: int) -> dict[str, NDArray[Any]]:
    required, optional = ID_COLUMNS[task], OPTIONAL_COLUMNS[task]
    columns: dict[str, NDArray[Any]] = {}
    for name, column in node.entries():
        if name in required or name in optional:
            columns[name] = column.whole_column(least=0 if name in required else -1)
        else:
            known = _metric(column, name, task)
            columns[name] = column.number_column(0.0, known.largest)
    for name in required:
        if name not in columns:
            raise node.error(f"the column {name!r}", "none of that name")
    ids = columns[required[0]]
    for name, values in columns.items():
        if len(values) != len(ids):
            raise node.error(
                f"columns of equal length, {len(ids)} as {required[0]}",
                f"a column {name} of {len(values)}",
            )
    if not len(ids):
        raise node.error("at least one entry in each column", "none")
    names, times = np.unique(ids, return_counts=True)
    if len(names) < len(ids):
        twice = names[int(np.argmax(times > 1))]
        raise node.error(f"each {required[0]} once", f"{required[0]} {twice} twice")
    answers = columns.get("iqtt_accuracy")
    if answers is not None and runs == 1 and not np.isin(answers, (0.0, 1.0)).all():
        first = float(answers[int(np.argmin(np.isin(answers, (0.0, 1.0))))])
        raise node.error("0 or 1 for one run", f"an iqtt_accuracy of {first!r}")
    return columns


def _scores(node: Node, task: str, meta: Meta, most: int) -> dict[str, Score]:
    return {name: _score(value, name, task, meta, most) for name, value in node.entries()}


def _score(node: Node, name: str, task: str, meta: Meta, most: int) -> Score:
    known = _metric(node, name, task)
    found = node.fields(("value", "low", "high", "unit", "n", "std"))
    if found["unit"].text() != known.unit:
        raise found["unit"].error(repr(known.unit))
    value = found["value"].number(0.0, known.largest)
    low, high = (found[end].number_or_null() for end in ("low", "high"))
    if (low is None) != (high is None):
        raise node.error("both ends of the interval, or null for both", "one end")
    if low is not None and high is not None and low > high:
        raise node.error("low to be at most high", f"low {low!r} and high {high!r}")
    std = found["std"].number_or_null(0.0)
    if std is not None and len(meta.submissions) == 1:
        raise found["std"].error("null, as there is one run")
    return Score(value, low, high, known.unit, found["n"].whole(1, most), std)


def _groups(node: Node, task: str, meta: Meta, items: Mapping[str, NDArray[Any]]) -> Groups:
    pattern, expected = _GROUP_KEYS[node.where]
    groups = {}
    for name, value in node.entries():
        if not re.fullmatch(pattern, name):
            raise value.error(f"{expected} as key", repr(name))
        groups[name] = _scores(value, task, meta, len(items[ID_COLUMNS[task][0]]))
    return groups


def _metric(node: Node, name: str, task: str) -> Metric:
    try:
        known = metric(name)
    except UnknownMetricError:
        known = None
    if known is None or known.task != task:
        raise node.error("a name listed in docs/scores.md", f"no score of task {task!r}")
    return known


def _check_agreement(node: Node, scores: ScoreFile, name: str, stored: Score) -> None:
    """A score has to be the mean of its column: over views within scenes, then over scenes."""
    column = scores.items.get(name)
    if column is None or np.isnan(column).any():
        return
    with np.errstate(over="ignore"):
        mean = float(_means(column, scores.clusters).mean())
    if abs(stored.value - mean) > AGREEMENT * max(abs(mean), abs(stored.value)):
        raise node.error(
            f"{mean!r}, the mean of items.{name} over scenes", f"{name}.value {stored.value!r}"
        )


def _means(column: NDArray[np.float64], clusters: NDArray[Any]) -> NDArray[np.float64]:
    index = np.unique(clusters, return_inverse=True)[1]
    return np.bincount(index, column) / np.bincount(index)
