"""Score files: `bench score` writes them; `compare`, `leaderboard` and other programs read them.

A file holds the scores of each item and their sources. `ScoreFile` computes all other numbers from
these on demand; the `summary` of the file repeats some for people, and is not read.
docs/score-file.md describes the format. Numbers that are written here read back to the same bits.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, FailFast, Field, TypeAdapter

from metrics.measured.protocols import BY_NAME
from metrics.measures.alignment import Alignment
from metrics.measures.checks import LARGEST_MAGNITUDE
from metrics.measures.objects import LEAST_PIXELS
from metrics.scoring.estimates import ACCURACY
from metrics.scoring.known_tests import known_test
from metrics.scoring.metric_names import (
    OBJECT_SCORES,
    OF_TRUTH,
    Metric,
    UnknownMetricError,
    in_order,
    metric,
)
from metrics.scoring.records import (
    COUNTS,
    GROUPINGS,
    ID_COLUMNS,
    OBJECT_COLUMNS,
    OPTIONAL_COLUMNS,
    SHAPE_COLUMN,
    AnswerGroups,
    Label,
    Length,
    Meta,
    Name,
    Number,
    Score,
    ScoreFile,
    Skill,
    Submission,
    Task,
)
from metrics.submissions.layout import Shown
from metrics.submissions.problems import JsonError
from metrics.submissions.strict_json import (
    LARGEST_WHOLE,
    parse_json,
    read_bytes,
    refusal,
    shown,
    validated,
)
from scenegen.common.text_table import by_number
from scenegen.files.new_file import written_beside

FORMAT_NAME = "pix2shape-bench/scores"
FORMAT_VERSION = "2.0"
MOST_BYTES = 256 * 2**20  # more images than may be parsed, see `strict_json.MOST_MEMORY`
MOST_KEYS = 10_000  # of one object
ROUNDING = 1e-9  # by which an accuracy may lie outside of its interval
RESAMPLES = range(100, 100_001)  # as many as `bench score` takes
WITHOUT_JSON = "about 140,000 images fit; --csv writes the scores of any number of them"
SCORE_AGAIN = "score the submission again with this release"
Array = NDArray[Any]
_NUMBERS = TypeAdapter(Annotated[list[Number | None], FailFast()])
_WHOLE_NUMBERS = TypeAdapter(
    Annotated[list[Annotated[int, Field(strict=True, le=LARGEST_WHOLE)]], FailFast()]
)
_LABELS = TypeAdapter(Annotated[list[Label], FailFast()])
# Limits of whole numbers; ids of objects are int8 in rooms files.
_LIMITS = {
    "object": (1, 127),
    "pixels": (LEAST_PIXELS, LARGEST_WHOLE),
    "view_angle_degrees": (-179, 180),
}

__all__ = [
    "FORMAT_NAME",
    "FORMAT_VERSION",
    "JsonError",
    "Meta",
    "Score",
    "ScoreFile",
    "Skill",
    "Submission",
    "read_scores",
    "to_json",
    "write_scores",
]


@dataclass(frozen=True)
class _Stored:
    """The keys of a score file."""

    __pydantic_config__ = ConfigDict(extra="forbid")
    format: Literal["pix2shape-bench/scores"]
    format_version: Literal["1.0", "2.0"]
    task: Task
    method: Name
    alignment: Alignment
    meta: Meta
    items: dict[str, Any]
    objects: dict[str, Any] = field(default_factory=dict)
    answer_groups: AnswerGroups = field(default_factory=dict)
    shown: Shown = "scored_view"
    protocol: str = ""
    length: Length = "scene unit"
    summary: Any = None


def read_scores(path: str | Path) -> ScoreFile:
    """Read and check a score file.

    Raises:
        OSError: the file cannot be read.
        JsonError: the file is not a score file, or is damaged.
    """
    path = Path(path)
    with _naming(path):
        document = parse_json(read_bytes(path, MOST_BYTES), MOST_KEYS)
        return replace(_checked(document), path=path)


def write_scores(scores: ScoreFile, path: str | Path, overwrite: bool = False) -> None:
    """Write scores; the file appears when it is complete and has passed the reader's checks.

    Raises:
        OSError: the file cannot be written, or exists and must not be overwritten.
        JsonError: the file would be invalid.
    """
    with written_beside(path, overwrite) as temporary, _naming(path):
        document = _document(scores)
        _checked(document)
        data = _text(document).encode("ascii")
        if len(data) > MOST_BYTES:
            raise JsonError("", f"{len(data)} bytes", f"at most {MOST_BYTES}", WITHOUT_JSON)
        temporary.write_bytes(data)


def to_json(scores: ScoreFile) -> str:
    """Return the text of a score file: keys in a fixed order, a line for each column of items."""
    return _text(_document(scores))


def _document(scores: ScoreFile) -> dict[str, Any]:
    """Return what a score file holds, as parsed JSON."""
    groups = {
        grouping: {key: asdict(groups[key]) for key in by_number(groups)}
        for grouping, groups in scores.answer_groups.items()
    }
    objects = _table(scores.object_columns, (*OBJECT_COLUMNS, SHAPE_COLUMN))
    return {
        "format": FORMAT_NAME,
        "format_version": FORMAT_VERSION,
        "task": scores.task,
        "method": scores.method,
        "alignment": scores.alignment,
        **({"shown": scores.shown} if scores.task == "rooms" else {}),
        **({"protocol": scores.protocol} if scores.protocol else {}),
        **({"length": scores.length} if scores.length != "scene unit" else {}),
        "summary": {
            "comparable": scores.comparable,
            "warnings": scores.warnings,
            "metrics": {name: vars(scores.metrics[name]) for name in in_order(scores.metrics)},
            "skills": {name: vars(scores.skills[name]) for name in in_order(scores.skills)},
        },
        "meta": asdict(scores.meta),
        **({"answer_groups": groups} if groups else {}),
        "items": _table(scores.columns, (*ID_COLUMNS[scores.task], *OPTIONAL_COLUMNS[scores.task])),
        **({"objects": objects} if objects else {}),
    }


def _table(columns: Mapping[str, Array], first: Sequence[str]) -> dict[str, list[Any]]:
    names = [name for name in first if name in columns]
    names += in_order(name for name in columns if name not in first)
    return {name: _listed(columns[name]) for name in names}


def _text(document: Mapping[str, Any]) -> str:
    """Return a document as text, of which each column is one line."""
    tables = {key: document[key] for key in ("items", "objects") if key in document}
    head = {key: value for key, value in document.items() if key not in tables}
    # Only ASCII, as one wide character makes the whole text take 4 bytes a character when read.
    text = json.dumps(head, indent=2, allow_nan=False)
    for key, columns in tables.items():
        lines = (f"    {json.dumps(name)}: {json.dumps(c)}" for name, c in columns.items())
        text = text[:-2] + f',\n  "{key}": {{\n' + ",\n".join(lines) + "\n  }\n}"
    return f"{text}\n"


def _listed(column: Array) -> list[Any]:
    """Return a column, or one for each of several runs, as lists, with None for no number."""
    if column.ndim == 2:
        return _listed(column[0]) if len(column) == 1 else [_listed(run) for run in column]
    values: list[Any] = column.tolist()
    if column.dtype.kind != "f" or np.isfinite(column).all():
        return values
    return [value if math.isfinite(value) else None for value in values]


@contextmanager
def _naming(path: str | Path) -> Iterator[None]:
    """Put the path into a JsonError."""
    try:
        yield
    except JsonError as error:
        raise error.inside(path) from error


def _checked(document: Any) -> ScoreFile:
    """Return the scores of a file's document. Raises JsonError at the first wrong thing."""
    try:
        stored = validated(_Stored, _without_noise(document))
    except JsonError as error:
        hint = SCORE_AGAIN if error.where == "format_version" else ""
        raise JsonError(error.where, error.found, error.expected, hint) from error
    task, runs = stored.task, len(stored.meta.submissions)
    if task == "iqtt":
        for name, empty in (("objects", {}), ("alignment", "none"), ("shown", "scored_view")):
            if getattr(stored, name) != empty:
                raise refusal(name, shown(getattr(stored, name)), f"{empty!r} for questions")
    named = [*BY_NAME] if task == "measured" else [""]
    if stored.protocol not in named or (task == "measured" and stored.objects):
        what = "objects" if stored.protocol in named else "protocol"
        expected = "none" if what == "objects" else f"one of {', '.join(map(repr, named))}"
        raise refusal(what, shown(getattr(stored, what)), expected)
    if stored.format_version == "1.0":
        _mend_angles(stored.items)
    columns = _item_columns(stored.items, task, runs)
    objects = _object_columns(stored.objects, columns[ID_COLUMNS[task][0]], runs)
    scores = ScoreFile(
        task,
        stored.method,
        stored.alignment,
        columns,
        stored.meta,
        objects,
        stored.answer_groups,
        shown=stored.shown,
        protocol=stored.protocol,
        length=stored.length,
        older=stored.format_version != FORMAT_VERSION,
    )
    _check_meta(scores)
    _check_groups(scores)
    return scores


def _without_noise(document: Any) -> Any:
    """Leave out the noise floors of format 1.0, which were no floor of anything."""
    meta = document.get("meta") if isinstance(document, dict) else None
    if isinstance(meta, dict) and document.get("format_version") == "1.0":
        meta.pop("noise_floors", None)
    return document


def _mend_angles(items: dict[str, Any]) -> None:
    """Put null where format 1.0 has -1: an angle that is not known. Its angles have no sign."""
    angles = items.get("view_angle_degrees")
    if isinstance(angles, list):
        items["view_angle_degrees"] = [None if angle == -1 else angle for angle in angles]


def _item_columns(stored: Mapping[str, Any], task: str, runs: int) -> dict[str, Array]:
    """Return the columns of items as arrays."""
    first = ID_COLUMNS[task]
    required = (*first, ACCURACY) if task == "iqtt" else first
    whole = (*first, *OPTIONAL_COLUMNS[task])
    columns = _columns("items", stored, required, whole, task, runs)
    if all(name in whole or name.startswith(OF_TRUTH) for name in columns):
        raise refusal("items", "no score", "at least one")
    ids = columns[first[0]]
    falls = np.flatnonzero(np.diff(ids) <= 0)
    if not len(ids) or len(falls):
        found = f"{ids[falls[0] + 1]} after {ids[falls[0]]}" if len(ids) else "no entries"
        raise refusal(f"items.{first[0]}", found, "numbers that ascend")
    gaps_of: dict[str, Array] = {}
    for name, column in columns.items():
        lacking = "" if name in whole else metric(name).lacking
        if lacking:  # all scores of objects, and all of relief, lack the same rows
            gaps = np.isnan(np.atleast_2d(column))
            wrong = (gaps != gaps_of.setdefault(lacking, gaps[0])).any(axis=0)
            if wrong.any():
                place = f"items.{name}[{int(np.argmax(wrong))}]"
                raise refusal(place, "null or a number", f"as in the other scores of {lacking}")
    return columns


def _object_columns(stored: Mapping[str, Any], rows: Array, runs: int) -> dict[str, Array]:
    """Return the columns of single objects in these rows; no column where none is stored."""
    if not stored:
        return {}
    names = (*OBJECT_COLUMNS, SHAPE_COLUMN, *OBJECT_SCORES)
    for name in stored:
        if name not in names:
            raise refusal(f"objects.{name:.60}", "an unknown key", "no key of this name")
    columns = _columns("objects", stored, names, OBJECT_COLUMNS, "rooms", runs)
    for name in OBJECT_SCORES:
        if np.isnan(columns[name]).any():
            raise refusal(f"objects.{name}", "null", "numbers")
    if not np.isin(columns["row"], rows).all():
        raise refusal("objects.row", "a row that items lack", "rows of items")
    keys = np.stack([columns["row"], columns["object"]])
    if len(np.unique(keys, axis=1).T) < len(keys.T):
        raise refusal("objects.object", "an object twice in a row", "each once")
    return columns


def _columns(
    place: str,
    stored: Mapping[str, Any],
    required: Sequence[str],
    whole: Sequence[str],
    task: str,
    runs: int,
) -> dict[str, Array]:
    """Return columns of equal length as arrays; those that are not `whole` numbers are scores."""
    for name in required:
        if name not in stored:
            raise refusal(f"{place}.{name}", "no such key", "it to be there")
    columns: dict[str, Array] = {}
    for name, values in stored.items():
        where = f"{place}.{name:.60}"
        if name in whole:
            limits = _LIMITS.get(name, (0, LARGEST_WHOLE))
            # An angle may be unknown, null.
            angles = name == "view_angle_degrees"
            columns[name] = _numbers(where, values, *limits, whole=not angles)
            if angles and (columns[name] % 1.0 > 0.0).any():
                raise refusal(where, "part of a degree", "whole degrees, or null")
        elif name == SHAPE_COLUMN and place == "objects":
            with _naming(where):
                columns[name] = np.array(validated(_LABELS, values), object)
        else:
            columns[name] = _scores(where, values, name, task, runs)
        count = columns[required[0]].shape[-1] if required[0] in columns else None
        if count not in (None, columns[name].shape[-1]):
            found = f"{columns[name].shape[-1]} entries"
            raise refusal(where, found, f"{count}, as in {required[0]}")
    return columns


def _scores(place: str, values: Any, name: str, task: str, runs: int) -> Array:
    """Return a column of scores: (R, N) for R runs, but (N,) for those of the empty room."""
    score = _known_metric(place, name, task)
    limits = score.smallest, min(score.largest, LARGEST_MAGNITUDE)
    if name.startswith(OF_TRUTH):
        column = _numbers(place, values, *limits)
    elif runs == 1:
        column = _numbers(place, values, *limits)[None]
    elif not isinstance(values, list) or len(values) != runs:
        raise refusal(place, shown(values), f"a list for each of the {runs} runs")
    else:
        each = [_numbers(f"{place}[{i}]", run, *limits) for i, run in enumerate(values)]
        if len(set(map(len, each))) > 1:
            raise refusal(place, "runs of different lengths", "as many entries in each run")
        column = np.stack(each)
    if not score.lacking and np.isnan(column).any():
        raise refusal(place, "null", "a number in each entry")
    if name == ACCURACY and not np.isin(column, (0.0, 1.0)).all():
        raise refusal(place, "a number between 0 and 1", "0 or 1 for each question")
    return column


def _known_metric(place: str, name: str, task: str) -> Metric:
    """Return what a score is. Raises JsonError for a name that is no score of the task."""
    try:
        score = metric(name)
    except UnknownMetricError:
        score = None
    if score is None or task not in score.tasks:
        raise refusal(place, f"no score of task {task!r}", "a name listed in docs/data/metrics.csv")
    return score


def _numbers(place: str, values: Any, least: float, most: float, whole: bool = False) -> Array:
    """Return a list of numbers within limits as an array (N,); null is NaN among floats."""
    with _naming(place):
        if whole:
            column = np.array(validated(_WHOLE_NUMBERS, values), np.int64)
        else:
            column = np.array(validated(_NUMBERS, values), np.float64)
    outside = (column < least) | (column > most)
    if outside.any():
        i = int(np.argmax(outside))
        limits = f"from {least:g} to {most:g}" if most < LARGEST_WHOLE else f"from {least:g}"
        raise refusal(f"{place}[{i}]", repr(column[i].item()), f"a number {limits}")
    return column


def _check_meta(scores: ScoreFile) -> None:
    """Raise JsonError unless what is said of the items can be true of them."""
    meta, ids, task = scores.meta, scores.ids, scores.task
    counts = meta.counts
    if sorted(counts) != sorted(COUNTS[task]):
        raise refusal("meta.counts", ", ".join(counts), ", ".join(COUNTS[task]))
    total = COUNTS[task][0]
    test = known_test(meta.truth_digest)
    largest = int(scores.object_columns["pixels"].max(initial=1)) if scores.object_columns else 1
    formula = task == "iqtt" and scores.runs == 1
    rules = [
        (total, counts[total] > ids.max(), f"more than {ids.max()}, the largest number in items"),
        ("rows_penalised", counts.get("rows_penalised", 0) <= len(ids), f"at most {len(ids)}"),
        ("pixels", counts.get("pixels", 1) >= largest, f"at least {largest}, as in objects"),
        ("answers", counts.get("answers", 2) in (2, 3), "2 or 3, of each question"),
    ]
    if test is not None:
        if test.task != task:
            raise refusal(
                "meta.truth_digest", f"that of {test.name}", f"ground truth of task {task!r}"
            )
        rules.append((total, counts[total] == test.rows, f"{test.rows}, as {test.name} has"))
    for name, holds, expected in rules:
        if not holds:
            raise refusal(f"meta.counts.{name}", shown(counts[name]), expected)
    if meta.resamples not in ((0,) if formula else RESAMPLES):
        expected = "0, as the interval is Wilson's" if formula else "100 to 100000"
        raise refusal("meta.resamples", shown(meta.resamples), expected)
    if len({submission.sha256 for submission in meta.submissions}) < scores.runs:
        raise refusal("meta.submissions", "the same sha256 twice", "each submission once")


def _check_groups(scores: ScoreFile) -> None:
    """Raise JsonError unless the groups of questions add up to all of them."""
    groupings = GROUPINGS[scores.task] if scores.task == "iqtt" else ()
    for grouping, groups in scores.answer_groups.items():
        place = f"answer_groups.{grouping:.60}"
        if grouping not in groupings:
            raise refusal(place, "an unknown key", "no key of this name")
        for key, group in groups.items():
            if len(group.right) != scores.runs or max(group.right) > group.n:
                found = f"{group.right} of {group.n} right"
                raise refusal(f"{place}.{key}.right", found, "as many numbers as runs, up to n")
            value, ends = group.score.value, (group.low, group.high)
            low, high = (value if end is None else end for end in ends)
            if ends.count(None) == 1 or not low - ROUNDING <= value <= high + ROUNDING:
                found = f"{value} outside of {ends}"
                raise refusal(f"{place}.{key}", found, "an interval that contains the accuracy")
        right = np.sum([group.right for group in groups.values()], axis=0)
        total = scores.columns[ACCURACY].sum(axis=1)
        questions = sum(group.n for group in groups.values())
        of_all = len(scores.ids)
        if grouping == "by_circle":  # of those that were asked in every order
            wrong = (right > total) | (questions > of_all)
        else:
            wrong = (right != total) | (questions != of_all)
        if wrong.any():
            found = f"{right} right of {questions} questions"
            raise refusal(place, found, f"{total} of {len(scores.ids)}, as in items")
