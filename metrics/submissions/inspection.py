"""What an HDF5 submission holds, and everything that is wrong with it before any truth is known.

Nothing here raises on broken content, or follows a link out of the file. Ids and answers are read
whole, pixels not at all.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import h5py
import numpy as np

from metrics.measures.answers import answers_from_scores
from metrics.submissions import layout
from metrics.submissions.problems import Problem
from metrics.submissions.rules import (
    Against,
    Array,
    Ids,
    array_problem,
    as_doubles,
    kind_text,
    shape_text,
    value_problems,
)
from scenegen.common.errors import FileFormatError
from scenegen.files.input_file import Fault, StoredArray, faults, reading, slab_bytes
from scenegen.files.schema import Column

CHUNK_SLOTS = 10_007
LEAST_CACHE = 1 << 20
BLOCK_ROWS = 65_536


@dataclass
class Inspection:
    """What was found in a submission.

    Attributes:
        task: None where it is none of `layout.TASKS`.
        texts: its root attributes that are as they should be.
        arrays: the data sets that can be used, by name: stored ones, or arrays.
        ids: (M,) int64, rows of the ground truth or indices of questions; None where they are
        unusable. answers: (M,) int64, of an iqtt submission; None where they are unusable.
    """

    task: str | None = None
    texts: dict[str, str] = field(default_factory=dict)
    arrays: dict[str, Any] = field(default_factory=dict)
    ids: Ids | None = None
    answers: Ids | None = None
    problems: list[Problem] = field(default_factory=list)


def inspect(file: h5py.File) -> Inspection:
    """Check attributes, layout, ids and answers of an open file; never raise on its content."""
    result = Inspection()
    texts = {a.name: text for a in layout.ATTRIBUTES if (text := _text(file, a)) is not None}
    head = [texts[name] for name in ("format", "format_version") if name in texts]
    if any(isinstance(text, Problem) for text in head):  # then the others mean nothing
        result.problems = [next(text for text in head if isinstance(text, Problem))]
        return result
    take_texts(result, texts)
    result.task = result.texts.get("task")
    if result.task is None:
        return result
    if result.task != "iqtt" and result.texts.get("truth_fingerprint") == "":
        expected = "the attribute 'fingerprint' of the rooms file"
        result.problems.append(Problem("truth_fingerprint", "value", expected, "an empty text"))
    file_faults = list(faults(file))
    for fault in file_faults:
        if fault.rule == "count":  # the objects after these were not looked at
            result.problems.append(Problem("file", fault.rule, fault.expected, fault.found))
            return result
    _take_arrays(file, result, layout.COLUMNS[result.task], file_faults)
    _check_alignment(result)
    take_values(result)
    return result


# ---- root attributes ----


def take_texts(result: Inspection, texts: Mapping[str, str | Problem]) -> None:
    """Take the root attributes that are as they should be, and what is wrong with the others."""
    for attribute in layout.attributes(str(texts.get("task", ""))):
        text = texts.get(attribute.name)
        if isinstance(text, Problem):
            result.problems.append(text)
        elif text is not None:
            fault = layout.text_fault(attribute, text)
            if fault is None:
                result.texts[attribute.name] = text
            else:
                result.problems.append(Problem(attribute.name, "value", fault[1], fault[0]))


def _text(file: h5py.File, attribute: layout.Attribute) -> str | Problem | None:
    """Return a root attribute, or what is wrong with it; None where it may be missing."""
    name = attribute.name
    try:
        with reading(name):
            if name not in file.attrs:
                expected = " or ".join(map(repr, attribute.choices)) or attribute.meaning
                missing = Problem(name, "present", expected, "no such root attribute")
                return missing if attribute.required else None
            stored = file.attrs.get_id(name)
            if stored.shape != () or h5py.check_string_dtype(stored.dtype) is None:
                return Problem(name, "type", "a text", f"{stored.dtype} of shape {stored.shape}")
            value = file.attrs[name]
    except FileFormatError as error:
        return _unreadable(name, "a text", error)
    try:
        text = value.decode() if isinstance(value, bytes) else str(value)
    except UnicodeDecodeError:
        return Problem(name, "type", "a text", "bytes that are not UTF-8")
    if name in ("format", "format_version") and text not in attribute.choices:
        kind = layout.DATA_FORMATS.get(text)
        what = f", a file of {kind}, not a submission" if kind else ""
        expected = repr(attribute.choices[0]) + (", and give this file to --truth" if kind else "")
        return Problem(name, "value", expected, f"{text!r:.60}{what}")
    return text


def _unreadable(name: str, expected: str, error: FileFormatError) -> Problem:
    return Problem(name, "readable", expected, str(error).removeprefix(f"{name}: "))


# ---- data sets ----


def _take_arrays(
    file: h5py.File, result: Inspection, columns: Sequence[Column], file_faults: Sequence[Fault]
) -> None:
    """Open the data sets of the layout that can be used; all have as many rows as the first."""
    count, before = None, len(result.problems)
    sizes: dict[str, tuple[int, ...]] = dict(layout.SIZES)
    for column in columns:
        array, problems = _opened(file, column, count, sizes, file_faults)
        result.problems += problems
        if array is None:
            continue
        result.arrays[column.name] = array
        if column is columns[0]:
            count = array.shape[0]
        for axis, size in zip(column.axes or (), array.shape[1:], strict=True):
            sizes[axis] = (size,)
    present = {problem.dataset for problem in result.problems} | set(result.arrays)
    if result.task == "iqtt" and not {"answer", "scores"} & present:
        found = f"neither; found {_names(file)}"
        result.problems.append(Problem("answer", "present", "answer or scores", found))
    if result.task != "iqtt":
        result.problems[before:before] = _kind_problems(present, file)


def _kind_problems(present: set[str], file: h5py.File) -> list[Problem]:
    """Return what is wrong unless exactly one kind of geometry is there."""
    kinds = [kind for kind in layout.KINDS if kind in present]
    expected = f"one of {', '.join(layout.KINDS)}"
    if not kinds:
        return [Problem("depth", "present", expected, f"no such dataset; found {_names(file)}")]
    return [
        Problem(kind, "unique", expected, f"it in addition to {kinds[0]}") for kind in kinds[1:]
    ]


def _check_alignment(result: Inspection) -> None:
    """Refuse an alignment that the kind of geometry does not allow."""
    alignment = result.texts.get("alignment")
    kind = next((kind for kind in layout.KINDS if kind in result.arrays), None)
    if alignment and kind and alignment not in layout.KINDS[kind]:
        expected = f"{' or '.join(layout.KINDS[kind])}, for {kind}"
        result.problems.append(Problem("alignment", "value", expected, repr(alignment)))


def _opened(
    file: h5py.File,
    column: Column,
    count: int | None,
    sizes: dict[str, tuple[int, ...]],
    file_faults: Sequence[Fault],
) -> tuple[StoredArray | None, list[Problem]]:
    """Open a data set; None with what is wrong with it, or where it may be missing."""
    name = column.name
    try:
        with reading(name):
            if file.get(name, getlink=True) is None:
                expected = f"{shape_text(column, None, layout.SIZES)} {kind_text(column)}"
                found = f"no such dataset; found {_names(file)}"
                needed = layout.NEEDED.get(name) == ""
                return None, [Problem(name, "present", expected, found)] if needed else []
            problems = [
                Problem(name, fault.rule, fault.expected, fault.found)
                for fault in file_faults
                if fault.name == name
            ]
            if any(problem.rule == "link" for problem in problems):
                return None, problems
            problem = _item_problem(file[name], column, count, sizes)
            problems = [problem] if problem else problems
            return None if problems else _with_cache(file, name), problems
    except FileFormatError as error:
        return None, [_unreadable(name, kind_text(column), error)]


def _item_problem(
    item: Any, column: Column, count: int | None, sizes: dict[str, tuple[int, ...]]
) -> Problem | None:
    if isinstance(item, h5py.Dataset):
        return array_problem(column, item, count, sizes)
    return Problem(column.name, "type", "a dataset", f"a {type(item).__name__.lower()}")


def _names(file: h5py.File) -> str:
    """Return the names of the first few objects in a file, for a message."""
    first = [f"{name!r:.40}" for name in itertools.islice(file, 9)]
    return ", ".join(first[:8] + ["..."] * (len(first) > 8)) or "none at all"


def _with_cache(file: h5py.File, name: str) -> StoredArray:
    """Open a dataset so that chunks of many rows are not unpacked anew for each of them.

    It must not be open already: an open dataset keeps the cache that it has.
    """
    stored = file[name]
    size = slab_bytes(stored.shape, stored.chunks, stored.dtype.itemsize) if stored.chunks else 0
    del stored
    access = h5py.h5p.create(h5py.h5p.DATASET_ACCESS)
    access.set_chunk_cache(CHUNK_SLOTS, max(size, LEAST_CACHE), 1.0)
    return StoredArray(h5py.Dataset(h5py.h5d.open(file.id, name.encode(), access)))


# ---- ids and answers ----


def take_values(result: Inspection, known: Against | None = None) -> None:
    """Read and check the ids, and the answers where there are some, against what is known."""
    known = known or Against()
    name = layout.ID_NAMES[str(result.task)]
    values = _values(result, name, lambda array: array[()])
    if values is None:
        return
    if values.dtype == np.uint64 and values.size and values.max() > np.iinfo(np.int64).max:
        found = f"numbers up to {values.max()}"
        result.problems.append(Problem(name, "range", "rows of the ground truth", found))
        return
    ids = values.astype(np.int64)
    result.problems += value_problems(name, ids, ids, known)
    fov = _values(result, "fov_y_degrees", lambda array: as_doubles(array[()]))
    if fov is not None:
        result.problems += value_problems("fov_y_degrees", fov, ids)
    if len(ids):
        result.ids = ids
        _take_answers(result, ids, known)


def _take_answers(result: Inspection, ids: Ids, known: Against) -> None:
    """Read the answers, and those that follow from scores, which must agree."""
    before = len(result.problems)
    of_scores = _values(result, "scores", lambda scores: _answers(result, scores, ids))
    answers = _values(result, "answer", lambda array: array[()])
    if answers is not None:
        usable = of_scores if len(result.problems) == before else None
        against = replace(known, of_scores=usable)
        result.problems += value_problems("answer", answers, ids, against)
    if len(result.problems) == before:
        result.answers = of_scores if answers is None else answers.astype(np.int64)
    for name in ("outcome", "rotated"):
        values = _values(result, name, lambda array: array[()])
        if values is not None:
            against = replace(known, of_scores=result.answers)
            result.problems += value_problems(name, values, ids, against)


def _answers(result: Inspection, scores: Any, ids: Ids) -> Ids:
    """Return the answers (M,) of scores (M, A), up to the first score that is not finite."""
    answers = np.empty(len(ids), np.int64)
    for start in range(0, len(ids), BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        block = as_doubles(scores[rows])
        problems = value_problems("scores", block, ids[rows])
        result.problems += problems
        if problems:
            break
        answers[rows] = answers_from_scores(block)
    return answers


def _values(result: Inspection, name: str, read: Callable[[Any], Array]) -> Array | None:
    """Return what `read` makes of a data set; None where there is none, or it is damaged."""
    try:
        with reading(name):
            return read(result.arrays[name]) if name in result.arrays else None
    except FileFormatError as error:
        result.problems.append(_unreadable(name, "numbers", error))
        return None
