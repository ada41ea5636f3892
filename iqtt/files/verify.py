"""Check the files of a split: digests, rows, and some questions made again."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from iqtt.files.layout import FORMAT_VERSION
from iqtt.files.reader import QuestionsFile, open_tables
from iqtt.files.split import FILES
from iqtt.files.work import question_rows
from iqtt.questions.specs import SPLITS, QuestionSpec
from iqtt.render import groups, make_source, render_question
from scenegen.common.errors import FileFormatError
from scenegen.files.rows import content_problems
from scenegen.files.verify import (
    Check,
    listed_check,
    made_elsewhere,
    spread_rows,
)
from scenegen.rendering.backend import exact_kind, select_variant


def verify_split(
    folder: str | Path,
    items: int = 8,
    device: str = "auto",
    seed: int | None = None,
) -> list[Check]:
    """Check the files of a split, and make `items` questions of each of them again.

    Args:
        folder: as `iqtt make-split` writes it; the file of the answers to the test may be missing.
        seed: of a split whose files do not tell it. Without one, no question is made again.

    Raises OSError and FileFormatError as `QuestionsFile`; BackendError where the device cannot
    render here.
    """
    folder, checks = Path(folder), list[Check]()
    names = [name for split in SPLITS for name in FILES[split] if (folder / name).is_file()]
    if not names:
        raise FileNotFoundError(2, "holds no question files of iqtt make-split", str(folder))
    with ExitStack() as stack:
        opened: dict[str, list[QuestionsFile]] = {}
        spec: QuestionSpec | None = None
        for name in names:  # the file of answers, which may tell the seed, comes after the others
            tables = opened[name] = open_tables(folder / name)
            stack.enter_context(tables[0])
            problems = [problem for table in tables for problem in table.problems()]
            problems += content_problems(tables[0].opened, {})
            checks.append(listed_check(name, "all values match their SHA-256", problems))
            spec = tables[0].spec
            if spec is None:
                raise FileFormatError(folder / name, "a released file", "one of iqtt make-split")
        assert spec is not None
        gaps = list(_gaps(opened, spec))
        checks.append(listed_check("rows", "no question is missing or repeated", gaps))
        again = spec if seed is None else replace(spec, seed=seed)
        return [*checks, _made_again(opened, again, items, device)]


def _same(stored: Any, value: Any) -> bool:
    if np.asarray(stored).dtype.kind in "OS":
        return [bytes(text).decode() for text in stored] == list(value)
    return np.array_equal(stored, value, equal_nan=np.asarray(stored).dtype.kind == "f")


def _gaps(opened: Mapping[str, Sequence[QuestionsFile]], spec: QuestionSpec) -> Iterator[str]:
    """Yield which files have too few or too many questions."""
    for split in SPLITS:
        for name in FILES[split]:
            rows = sum(map(len, opened.get(name, ())))
            if name in opened and rows != getattr(spec, split):
                yield f"{name} has {rows} questions, not {getattr(spec, split)}"


def _made_again(
    opened: Mapping[str, Sequence[QuestionsFile]], spec: QuestionSpec, items: int, device: str
) -> Check:
    """Make some questions of each file again; `opened` are the tables of each, by its name."""
    title = "made again from the seed"
    if spec == spec.public():
        return Check(
            title, True, "not checked: the files do not store the seed; give --secret-seed"
        )
    here = {"format_version": FORMAT_VERSION, **exact_kind(select_variant(device))}
    told = [tables[0].attributes for tables in opened.values()]
    others = made_elsewhere(told[-1], here)
    if others:
        return Check(title, True, f"not checked: {'; '.join(others)}")
    source, wrong, count = make_source(spec), [], 0
    for split in SPLITS:
        name, answers = FILES[split][0], FILES[split][-1]
        for part, (first, rows) in groups(spec, split).items() if name in opened else ():
            table = opened[name][0].table(part)
            if answers != name and answers in opened:
                table.join(opened[answers][0])
            for row in spread_rows(rows, items):
                again = render_question(source, split, first + row, device)
                values, count = question_rows(spec, [again]), count + 1  # type: ignore[arg-type]
                if not all(_same(table.read(x, row), values[x][0]) for x in table.fields):
                    wrong.append(f"{name} {part} row {row}".replace("  ", " "))
    return listed_check(title, f"{count} questions, bit for bit", wrong)
