"""Check the files of a split: checksums or digests, rows, and some questions made again."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from iqtt.files.layout import FORMAT_VERSION
from iqtt.files.reader import QuestionsFile, open_tables
from iqtt.files.split import ALL_FILES, FILES, MANIFEST
from iqtt.questions.distractors import make_pools
from iqtt.questions.specs import SPLITS, SplitSpec
from iqtt.render import groups, render_question
from scenegen.common.errors import FileFormatError
from scenegen.files.rows import content_problems
from scenegen.files.sets.manifest import Manifest, read_manifest
from scenegen.files.sets.shards import shard_name
from scenegen.files.verify import (
    Check,
    listed_check,
    made_elsewhere,
    manifest_checks,
    spread_rows,
)
from scenegen.rendering.backend import exact_kind, select_variant


def verify_split(
    folder: str | Path,
    items: int = 8,
    device: str = "auto",
    seed: int | None = None,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Check]:
    """Check the files of a split, and make `items` questions of each of them again.

    Args:
        folder: as `iqtt make-split` writes it; the file of the answers to the test may be missing.
        seed: of a split whose files do not tell it. Without one, no question is made again.
        progress: called with the number of questions that were checked since the last call.

    Raises OSError and FileFormatError as `QuestionsFile` and `read_manifest`; BackendError where
    the device cannot render here.
    """
    folder, checks = Path(folder), list[Check]()
    names = [name for split in SPLITS for name in FILES[split] if (folder / name).is_file()]
    if not names:
        raise FileNotFoundError(2, "holds no question files of iqtt make-split", str(folder))
    if (folder / MANIFEST).exists():
        checks += _against_manifest(folder, read_manifest(folder / MANIFEST), progress)
        if not all(check.ok for check in checks):
            return checks
    with ExitStack() as stack:
        opened: dict[str, list[QuestionsFile]] = {}
        spec: SplitSpec | None = None
        for name in names:  # the file of answers, which may tell the seed, comes after the others
            tables = opened[name] = open_tables(folder / name)
            stack.enter_context(tables[0])
            problems = [problem for table in tables for problem in table.problems()]
            problems += content_problems(tables[0].opened, {})
            checks.append(listed_check(name, "every value and attribute, by SHA-256", problems))
            spec = tables[0].spec
            if spec is None:
                raise FileFormatError(folder / name, "a released file", "one of iqtt make-split")
        assert spec is not None
        again = spec if seed is None else replace(spec, seed=seed)
        return [*checks, _made_again(opened, again, items, device)]


def _against_manifest(
    folder: Path, manifest: Manifest, progress: Callable[[int], Any]
) -> list[Check]:
    if set(manifest.files) != set(ALL_FILES):
        found = ", ".join(manifest.files)
        raise FileFormatError(folder / MANIFEST, found[:80], "the files of a split")
    spec = SplitSpec.from_json(manifest.spec)
    total = sum(getattr(spec, split) for split in SPLITS)
    gaps = [] if manifest.count == total else [f"{manifest.count} questions, not {total}"]
    gaps += [problem for name in manifest.files for problem in _gaps(manifest, spec, name)]
    return [
        *manifest_checks(folder, manifest, progress),
        listed_check("rows", f"each of {total} questions once", gaps),
    ]


def _gaps(manifest: Manifest, spec: SplitSpec, name: str) -> Iterator[str]:
    """Yield what is missing of the shards of a file."""
    shards = manifest.shards_of(name)
    names = {shard_name(name, number, len(shards)) for number in range(len(shards))}
    for shard in shards:
        if shard.file != name and shard.file not in names:
            yield f"{shard.file} is not one of {len(shards)} shards"
    split = next(split for split in SPLITS if name in FILES[split])
    rows, expected = sum(shard.rows for shard in shards), getattr(spec, split)
    if rows != expected:
        yield f"{name} has {rows} questions, not {expected}"


def _made_again(
    opened: Mapping[str, Sequence[QuestionsFile]], spec: SplitSpec, items: int, device: str
) -> Check:
    """Make some questions of each file again; `opened` are the tables of each, by its name."""
    title = "made again from the seed"
    if spec == spec.public():
        return Check(title, True, "not checked: the files do not tell the seed")
    here = {"format_version": FORMAT_VERSION, **exact_kind(select_variant(device))}
    told = [tables[0].attributes for tables in opened.values()]
    others = made_elsewhere(told[-1], here)
    if others:
        return Check(title, True, f"not checked: {'; '.join(others)}")
    pools, wrong, count = make_pools(spec), [], 0
    for split in SPLITS:
        name, answers = FILES[split][0], FILES[split][-1]
        for part, (first, rows) in groups(spec, split).items() if name in opened else ():
            table = opened[name][0].table(part)
            if answers != name and answers in opened:
                table.join(opened[answers][0])
            for row in spread_rows(rows, items):
                again = render_question(pools, split, first + row, device)
                stored, count = table[row], count + 1
                same = np.array_equal(stored.images, again.images)
                if stored.truth is not None:
                    cubes = again.question.shapes.cubes
                    same &= np.array_equal(stored.truth.cubes, cubes)
                if not same:
                    wrong.append(f"{name} {part} row {row}".replace("  ", " "))
    return listed_check(title, f"{count} questions, bit for bit", wrong)
