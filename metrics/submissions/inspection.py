"""What an HDF5 submission holds, and everything that is wrong with it before any truth is known.

Nothing here raises on broken content, or follows a link out of the file. Ids and answers are read
whole, pixels not at all.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import h5py
import numpy as np

from metrics.measures.answers import CANDIDATES, answers_from_scores
from metrics.submissions import layout, rules
from metrics.submissions.problems import Problem
from scenegen.common.errors import FileFormatError
from scenegen.description.specs import MAX_PIXELS
from scenegen.files.input_file import Fault, StoredArray, faults, reading, slab_bytes

CHUNK_SLOTS = 10_007
LEAST_CACHE = 1 << 20
BLOCK_ROWS = 65_536


@dataclass
class Inspection:
    """What was found in a submission.

    Attributes:
        texts: its root attributes.
        task: None where it is neither of the two.
        ids: (M,) int64, rows of the truth or indices of questions; None where they are unusable.
        found: the datasets that can be used, by name.
        answers: (M,) int64, of an iqtt submission; None where they are unusable.
    """

    texts: dict[str, str] = field(default_factory=dict)
    task: str | None = None
    ids: rules.Ids | None = None
    found: dict[str, StoredArray] = field(default_factory=dict)
    answers: rules.Ids | None = None
    problems: list[Problem] = field(default_factory=list)


def inspect(file: h5py.File) -> Inspection:
    """Check attributes, layout, ids and answers of an open file; never raise on its content."""
    result = Inspection()
    result.texts, result.problems = read_texts(file)
    result.task = result.texts.get("task")
    if result.task is None:
        return result
    count, all_faults = None, list(faults(file))
    for fault in all_faults:
        if fault.rule == "count":  # the objects after these were not looked at
            result.problems.append(Problem("file", fault.rule, fault.expected, fault.found))
            return result
    for dataset in layout.datasets(result.task):
        item, problems = open_dataset(file, dataset, count, all_faults)
        result.problems += problems
        if item is not None:
            result.found[dataset.name] = item
            count = int(item.shape[0]) if dataset.name in layout.ID_NAMES.values() else count
    if result.task == "iqtt":
        known = {problem.dataset for problem in result.problems} | set(result.found)
        if not {"answer", "scores"} & known:
            found = f"neither; found {names(file)}"
            result.problems.append(Problem("answer", "present", "answer, or scores", found))
    _take_ids(result, layout.ID_NAMES[result.task])
    if result.task == "iqtt" and result.ids is not None:
        _take_answers(result, result.ids)
    return result


def read_texts(file: h5py.File) -> tuple[dict[str, str], list[Problem]]:
    """Return the root attributes that are as they should be, and what is wrong with the others.

    If the file has another format or version, that is the only problem returned.
    """
    wrong = _format_problem(file)
    if wrong is not None:
        return {}, [wrong]
    read = {attribute.name: _checked(file, attribute) for attribute in layout.ATTRIBUTES}
    task = read["task"] if isinstance(read["task"], str) else None
    theirs = layout.ATTRIBUTES if task is None else layout.attributes(task)
    found = {attribute.name: read[attribute.name] for attribute in theirs}
    texts = {name: text for name, text in found.items() if isinstance(text, str)}
    problems = [problem for problem in found.values() if isinstance(problem, Problem)]
    if task == "rooms" and texts.get("truth_fingerprint") == "":
        expected = "the attribute 'fingerprint' of the rooms file"
        problems.append(Problem("truth_fingerprint", "value", expected, "an empty text"))
    return texts, problems


def _format_problem(file: h5py.File) -> Problem | None:
    head = {}
    for attribute in layout.ATTRIBUTES[:2]:
        text = _read(file, attribute.name)
        if isinstance(text, Problem):
            return text
        head[attribute.name] = text
    name, version = head["format"], head["format_version"]
    if name is None:
        return Problem("format", "present", repr(layout.FORMAT_NAME), "no such root attribute")
    if name != layout.FORMAT_NAME:
        kind = layout.DATA_FORMATS.get(name)
        what = f", a file of {kind}, not a submission" if kind else ""
        return Problem("format", "value", repr(layout.FORMAT_NAME), f"{name!r:.60}{what}")
    major = layout.FORMAT_VERSION.split(".", maxsplit=1)[0]
    if version is None or version.split(".", maxsplit=1)[0] != major:
        found = "no such root attribute" if version is None else f"version {version!r:.20}"
        return Problem("format_version", "value", f"{major}.x", found)
    return None


def _checked(file: h5py.File, attribute: layout.Attribute) -> str | Problem | None:
    """Return a root attribute; None where there is none and none is needed."""
    text = _read(file, attribute.name)
    if isinstance(text, str):
        fault = layout.text_fault(attribute, text)
        return text if fault is None else Problem(attribute.name, "value", fault[1], fault[0])
    if text is None and attribute.required:
        return Problem(attribute.name, "present", attribute.meaning, "no such root attribute")
    return text


def _read(file: h5py.File, name: str) -> str | Problem | None:
    try:
        with reading(name):
            if name not in file.attrs:
                return None
            stored = file.attrs.get_id(name)
            if stored.shape != () or h5py.check_string_dtype(stored.dtype) is None:
                return Problem(name, "type", "a text", f"{stored.dtype} of shape {stored.shape}")
            value = file.attrs[name]
    except FileFormatError as error:
        return _unreadable(name, "a text", error)
    try:
        return value.decode() if isinstance(value, bytes) else str(value)
    except UnicodeDecodeError:
        return Problem(name, "type", "a text", "bytes that are not UTF-8")


def _unreadable(name: str, expected: str, error: FileFormatError) -> Problem:
    return Problem(name, "readable", expected, str(error).removeprefix(f"{name}: "))


def open_dataset(
    file: h5py.File, dataset: layout.Dataset, count: int | None, faults: Sequence[Fault]
) -> tuple[StoredArray | None, list[Problem]]:
    """Open a dataset that should have `count` rows, or any number if that is None.

    `faults` are those of the whole file. Returns None with what is wrong with it, or without a
    problem where it is not there and need not be.
    """
    name = dataset.name
    try:
        with reading(name):
            link = file.get(name, getlink=True)
            if link is None:
                expected = f"{dataset.shown_shape} {dataset.kind}"
                found = f"no such dataset; found {names(file)}"
                missing = Problem(name, "present", expected, found)
                return None, [missing] if dataset.required else []
            own = [fault for fault in faults if fault.name == name]
            problems = [Problem(name, f.rule, f.expected, f.found) for f in own]
            if not any(problem.rule == "link" for problem in problems):
                problems = _problems(file[name], dataset, count) or problems
            return None if problems else _open_with_cache(file, name), problems
    except FileFormatError as error:
        return None, [_unreadable(name, dataset.kind, error)]


def names(file: h5py.File) -> str:
    """Return the names of the first few objects in a file, for a message."""
    first = [f"{name!r:.40}" for name in itertools.islice(file, 9)]
    return ", ".join(first[:8] + ["..."] * (len(first) > 8)) or "none at all"


def _problems(item: Any, dataset: layout.Dataset, count: int | None) -> list[Problem]:
    """Return what is wrong with type and shape."""
    name = dataset.name
    if not isinstance(item, h5py.Dataset):
        return [Problem(name, "type", "a dataset", f"a {type(item).__name__.lower()}")]
    problems = []
    if item.dtype.kind not in dataset.kinds:
        problems.append(Problem(name, "type", dataset.kind, f"type {_type_name(item.dtype)}"))
    shape: tuple[int, ...] = item.shape or ()
    if not _fits(shape, dataset):
        problems.append(Problem(name, "shape", dataset.shown_shape, f"shape {item.shape}"))
    elif count is not None and shape[0] != count:
        problems.append(Problem(name, "count", f"{count}, one for each id", f"{shape[0]} rows"))
    elif shape[0] > layout.MOST_ROWS:
        problems.append(Problem(name, "count", f"at most {layout.MOST_ROWS:,}", f"{shape[0]} rows"))
    elif math.prod(shape[1:3]) > MAX_PIXELS:
        found = f"images of {shape[1]}x{shape[2]}"
        problems.append(Problem(name, "shape", f"at most {MAX_PIXELS:,} pixels", found))
    return problems


def _fits(shape: tuple[int, ...], dataset: layout.Dataset) -> bool:
    """Return whether a shape has the right axes; only the first one may be empty."""
    sizes = shape[1:]
    if not shape or len(sizes) != len(dataset.shape) or 0 in sizes:
        return False
    pairs = zip(dataset.shape, sizes, strict=True)
    return all(
        size in CANDIDATES
        if expected == layout.TWO_OR_THREE
        else isinstance(expected, str) or size == expected
        for expected, size in pairs
    )


def _open_with_cache(file: h5py.File, name: str) -> StoredArray:
    """Open a dataset so that chunks of many rows are not unpacked anew for each of them.

    It must not be open already: an open dataset keeps the cache that it has.
    """
    stored = file[name]
    size = slab_bytes(stored.shape, stored.chunks, stored.dtype.itemsize) if stored.chunks else 0
    del stored
    access = h5py.h5p.create(h5py.h5p.DATASET_ACCESS)
    access.set_chunk_cache(CHUNK_SLOTS, max(size, LEAST_CACHE), 1.0)
    return StoredArray(h5py.Dataset(h5py.h5d.open(file.id, name.encode(), access)))


def _type_name(dtype: np.dtype[Any]) -> str:
    if h5py.check_string_dtype(dtype) is not None:
        return "text"
    if h5py.check_ref_dtype(dtype) is not None:
        return "reference"
    return "compound" if dtype.names else str(dtype)


def _take_ids(result: Inspection, name: str) -> None:
    values = _taken(result, name, "integers", lambda item: item[()])
    if values is None:
        return
    if values.dtype == np.uint64 and values.size and values.max() > np.iinfo(np.int64).max:
        found = f"numbers up to {values.max()}"
        result.problems.append(Problem(name, "range", "rows of the truth", found))
        return
    ids = values.astype(np.int64)
    result.problems += rules.id_problems(ids, name)
    result.ids = ids if len(ids) else None


def _take_answers(result: Inspection, ids: rules.Ids) -> None:
    """Read the answers, and those that follow from scores, which must agree."""
    before = len(result.problems)
    answers = _taken(result, "answer", "numbers", lambda item: item[()])
    if answers is not None:
        result.problems += rules.answer_problems(answers, ids)
        answers = answers.astype(np.int64)
    from_scores = None
    if len(result.problems) == before:
        from_scores = _taken(result, "scores", "numbers", lambda item: _answers(result, item, ids))
    if len(result.problems) > before:
        return
    if answers is not None and from_scores is not None:
        result.problems += rules.agreement_problems(answers, from_scores, ids)
    result.answers = from_scores if answers is None else answers


def _answers(result: Inspection, scores: StoredArray, ids: rules.Ids) -> rules.Ids:
    """Return the answers (M,) of scores (M, A), up to the first score that is not finite."""
    answers = np.empty(len(ids), np.int64)
    for start in range(0, len(ids), BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        block = rules.as_doubles(scores[rows])
        problems = rules.score_problems(block, ids[rows])
        result.problems += problems
        if problems:
            break
        answers[rows] = answers_from_scores(block)
    return answers


def _taken(
    result: Inspection, name: str, expected: str, read: Callable[[StoredArray], rules.Array]
) -> rules.Array | None:
    """Return what `read` makes of a dataset; None where there is none, or it is damaged."""
    try:
        with reading(name):
            return read(result.found[name]) if name in result.found else None
    except FileFormatError as error:
        result.problems.append(_unreadable(name, expected, error))
        return None
