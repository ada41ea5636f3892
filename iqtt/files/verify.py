"""Check the files of a split: checksums or digests, rows, and some questions made again."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from iqtt.files.layout import FORMAT_VERSION
from iqtt.files.reader import AnswersFile, QuestionsFile, parts
from iqtt.files.shards import ALL_FILES, ANSWERS, FILES, MANIFEST
from iqtt.files.tables import TableFile
from iqtt.questions.distractors import make_pools
from iqtt.questions.specs import SPLITS, SplitSpec
from iqtt.render import groups, render_question
from scenegen.common.errors import FileFormatError
from scenegen.files.manifest import Manifest, read_manifest, wrong_files
from scenegen.files.row_file import digest_problems
from scenegen.files.shards import opened_with_shards, stored_array
from scenegen.rendering.backend import select_variant, versions
from scenegen.rooms.verify import Check, listed_check


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
    for name in names:
        with opened_with_shards(folder / name, "question file") as (file, shards):
            opened = partial(stored_array, shards=shards)
            problems = digest_problems(file, {}, opened)
        checks.append(listed_check(name, "every value and attribute, by SHA-256", problems))
    return [*checks, _made_again(folder, items, device, seed)]


def _against_manifest(
    folder: Path, manifest: Manifest, progress: Callable[[int], Any]
) -> list[Check]:
    if set(manifest.files) != set(ALL_FILES):
        found = ", ".join(manifest.files)
        raise FileFormatError(folder / MANIFEST, found[:80], "the files of a split")
    told = "every file is complete"
    whole = [] if manifest.complete else ["the split is not complete"]
    wrong = wrong_files(folder, manifest, progress)
    gaps = [problem for name in manifest.files for problem in _gaps(manifest, name)]
    return [
        listed_check("manifest", told, whole),
        listed_check("checksums", f"SHA-256 of {len(manifest.shards)} files", wrong),
        listed_check("rows", f"each of {manifest.count} questions once", gaps),
    ]


def _gaps(manifest: Manifest, name: str) -> Iterator[str]:
    """Yield where the shards of a file do not follow each other."""
    shards, following = manifest.shards_of(name), 0
    spec = SplitSpec.from_json(manifest.spec)
    for shard in shards:
        if shard.first != following or shard.rows != shard.items:
            yield f"{shard.file} begins with question {shard.first}, not {following}"
        following = shard.first + shard.items
    split = next(split for split in SPLITS if name in FILES[split])
    expected = sum(count for _, count in groups(spec, split).values())
    if following != expected:
        yield f"{name} has {following} questions, not {expected}"


def _any_table(folder: Path) -> TableFile:
    """Open a table of a split: that of the answers to the test, which may tell the seed, if any."""
    names = [name for split in ("test", "train", "val") for name in reversed(FILES[split])]
    path = next(folder / name for name in names if (folder / name).is_file())
    return AnswersFile(path) if path.name == ANSWERS else QuestionsFile(path, parts(path)[0])


def _made_again(folder: Path, items: int, device: str, seed: int | None) -> Check:
    """Make some questions of each file again, with the seed of the file of answers."""
    title = "made again from the seed"
    answers = folder / FILES["test"][-1]
    with _any_table(folder) as table:
        told, spec = table.attributes, table.spec
    assert spec is not None  # files of ours tell it
    if seed is not None:
        spec = replace(spec, seed=seed)
    if spec == spec.public():
        return Check(title, True, "not checked: the files do not tell the seed")
    here = {"variant": select_variant(device), "format_version": FORMAT_VERSION, **versions()}
    others = [f"{x} {told.get(x)}, here {here[x]}" for x in here if told.get(x) != here[x]]
    if others:
        return Check(title, True, f"not checked: {'; '.join(others)}")
    pools, wrong, count = make_pools(spec), [], 0
    for split in SPLITS:
        path = folder / FILES[split][0]
        for part, (first, rows) in groups(spec, split).items() if path.is_file() else ():
            beside = answers if split == "test" and answers.is_file() else None
            with QuestionsFile(path, part, beside) as questions:
                for row in np.unique(np.linspace(0, rows - 1, min(items, rows)).astype(int)):
                    again = render_question(spec, pools, split, first + int(row), device)
                    stored, count = questions[int(row)], count + 1
                    same = np.array_equal(stored.images, again.images)
                    if stored.truth is not None:
                        cubes = again.question.shapes.cubes
                        same &= np.array_equal(stored.truth.cubes, cubes)
                    if not same:
                        wrong.append(f"{path.name} {part} row {row}".replace("  ", " "))
    return listed_check(title, f"{count} questions, bit for bit", wrong)
