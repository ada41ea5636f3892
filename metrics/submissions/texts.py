"""The root attributes of an HDF5 submission, read and checked; nothing here raises on content."""

import h5py

from metrics.submissions.layout import (
    ATTRIBUTES,
    DATA_FORMATS,
    FORMAT_NAME,
    FORMAT_VERSION,
    Attribute,
    text_fault,
)
from metrics.submissions.problems import Problem
from scenegen.common.row_file import reason

READ_ERRORS = (OSError, RuntimeError, KeyError, TypeError, ValueError, MemoryError)


def read_texts(file: h5py.File) -> tuple[dict[str, str], list[Problem]]:
    """Return the root attributes that are as they should be, and what is wrong with the others.

    Of a file of another format or version nothing but that is told.
    """
    wrong = _format_problem(file)
    if wrong is not None:
        return {}, [wrong]
    texts, problems = {}, []
    for attribute in ATTRIBUTES:
        found = _checked(file, attribute)
        if isinstance(found, Problem):
            problems.append(found)
        elif found is not None:
            texts[attribute.name] = found
    task = texts.get("task")
    theirs = {a.name for a in ATTRIBUTES if task is None or task in a.tasks}
    problems = [problem for problem in problems if problem.dataset in theirs]
    if task == "rooms" and texts.get("truth_fingerprint") == "":
        expected = "the attribute 'fingerprint' of the rooms file"
        problems.append(Problem("truth_fingerprint", "value", expected, "an empty text"))
    return {name: text for name, text in texts.items() if name in theirs}, problems


def _format_problem(file: h5py.File) -> Problem | None:
    found = {}
    for attribute in ATTRIBUTES[:2]:
        text = _read(file, attribute.name)
        if isinstance(text, Problem):
            return text
        found[attribute.name] = text
    name, version = found["format"], found["format_version"]
    if name is None:
        return Problem("format", "present", repr(FORMAT_NAME), "no such root attribute")
    if name != FORMAT_NAME:
        what = f", a file of {DATA_FORMATS[name]}, not a submission" if name in DATA_FORMATS else ""
        return Problem("format", "value", repr(FORMAT_NAME), f"{name!r:.60}{what}")
    major = FORMAT_VERSION.split(".", maxsplit=1)[0]
    if version is None or version.split(".", maxsplit=1)[0] != major:
        got = "no such root attribute" if version is None else f"version {version!r:.20}"
        return Problem("format_version", "value", f"{major}.x", got)
    return None


def _checked(file: h5py.File, attribute: Attribute) -> str | Problem | None:
    """Return a root attribute; None where there is none and none is needed."""
    text = _read(file, attribute.name)
    if isinstance(text, str):
        fault = text_fault(attribute, text)
        return text if fault is None else Problem(attribute.name, "value", fault[1], fault[0])
    if text is None and attribute.required:
        return Problem(attribute.name, "present", attribute.meaning, "no such root attribute")
    return text


def _read(file: h5py.File, name: str) -> str | Problem | None:
    try:
        if name not in file.attrs:
            return None
        stored = file.attrs.get_id(name)
        if stored.shape != () or h5py.check_string_dtype(stored.dtype) is None:
            return Problem(name, "type", "a text", f"{stored.dtype} of shape {stored.shape}")
        value = file.attrs[name]
        return value.decode() if isinstance(value, bytes) else str(value)
    except UnicodeDecodeError:
        return Problem(name, "type", "a text", "bytes that are not UTF-8")
    except READ_ERRORS as error:
        return Problem(name, "readable", "a text", f"cannot be read ({reason(error)})")
