"""Make the files of a split of questions, or of a suite of splits; merge shards to one file."""

import errno
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from iqtt.files.reader import QuestionsFile
from iqtt.files.split import ALL_FILES, split_part, split_plan
from iqtt.files.work import QuestionsWork
from iqtt.questions.distractors import Pools, make_pools
from iqtt.questions.specs import SUITE, SplitSpec
from iqtt.questions.views import Tally
from iqtt.render import DEFAULT_BATCH
from scenegen.common.errors import FileFormatError
from scenegen.common.records import check
from scenegen.files.new_file import EXISTS, check_place
from scenegen.files.places import as_place, check_store, is_remote, remove_folder
from scenegen.files.sets.cluster import Cluster
from scenegen.files.sets.making import check_request, make_set, write_request
from scenegen.files.sets.plan import Part
from scenegen.files.sets.sets import merge_file
from scenegen.rendering.backend import select_variant, versions
from scenegen.rendering.renderer import useful_workers

SHARD_SIZE = 10_000  # questions


def make_split(
    folder: str | Path,
    spec: SplitSpec,
    *,
    batch: int = DEFAULT_BATCH,
    workers: int = 1,
    shard_size: int = SHARD_SIZE,
    device: str = "auto",
    overwrite: bool = False,
    compression: str = "gzip",
    command: str = "",
    secret: bool = False,
    cluster: Cluster | None = None,
    progress: Callable[[int], Any] = lambda done: None,
    pools: Pools | None = None,
) -> Tally:
    """Write the files of a split to a folder, each of which appears when it is complete.

    The same call goes on where an earlier one was killed. Seed and command would reveal the test
    answers, so only the file of the test answers has them.

    Args:
        folder: is made if it is not there; other files in it are left alone.
        batch: questions in one wavefront; bounds the memory, never changes a byte of the files.
        workers: processes that render, as in `rooms.make.make_dataset`.
        shard_size: files with more questions are cut into shards of so many, which the file shows
            as one.
        device, compression: as in `backend.DEVICES` and `table.COMPRESSIONS`.
        overwrite: replace older files of a split.
        command: what to record as the command that made the files.
        secret: keep the seed out of the file of the test answers too.
        cluster: whose workers make the files; all of them must see the folder, or it is a URL.
        progress: is called with the number of questions that were written since the last call.
        pools: of the spec, where they are made already.

    Returns how many views were proposed and refused.

    Raises:
        SpecError, TooFewShapesError: a setting, before anything is rendered.
        PlacementError: the bounded search found no question that meets the spec.
        OSError, SceneGenError: as `making.make_set`.
    """
    count = spec.train + spec.val + spec.test
    check(count > 0, "train, val and test", count, "at least 1 question in all")
    variant = select_variant(device)
    plan = split_plan(spec, {"variant": variant, **versions()}, compression, command, secret)
    tally = Tally()
    with _folder(as_place(folder)) as place:
        work = QuestionsWork(pools or make_pools(spec), batch, device, compression)
        make_set(
            place, plan, work, shard_size,
            workers=workers or useful_workers(count * (1 + spec.answers), variant),
            cluster=cluster, overwrite=overwrite, progress=progress, note=tally.add,
        )  # fmt: skip
    return tally


def make_suite(
    folder: str | Path, spec: SplitSpec, *, overwrite: bool = False, **options: Any
) -> Tally:
    """Write a split of each kind of questions to a folder of its own in `folder`: see `SUITE`.

    What could stop one of the splits is checked before the first one is made. Splits that an
    earlier run of the same request completed are kept.

    Args:
        spec: the settings of each split but its kind and number of answers.
        options: as for `make_split`.

    Raises as `make_split`.
    """
    specs = {
        name: replace(spec, distractors=kind, answers=answers)
        for name, (kind, answers) in SUITE.items()
    }
    tally = Tally()
    with _folder(as_place(folder)) as home, _suite_begun(home, spec, overwrite, **options) as kept:
        pools = {name: make_pools(of_split) for name, of_split in specs.items()}
        for name, of_split in specs.items():
            how: dict[str, Any] = {"pools": pools.pop(name), "overwrite": overwrite, **options}
            try:
                tally.add(make_split(home / name, of_split, **how))
            except FileExistsError:
                if not kept:
                    raise
    return tally


@contextmanager
def _suite_begun(
    home: Path,
    spec: SplitSpec,
    overwrite: bool,
    device: str = "auto",
    compression: str = "gzip",
    secret: bool = False,
    shard_size: int = SHARD_SIZE,
    **_: Any,
) -> Iterator[bool]:
    """Record the request of a suite until it is complete; give whether an earlier run began it.

    Raises FileExistsError where splits are there that it did not begin, and as `check_request`.
    """
    record = home / ".suite.parts"
    renderer = {"variant": select_variant(device), **versions()}
    request = split_plan(spec, renderer, compression, "", secret).request(shard_size)

    def begun() -> bool:
        return any((home / name / ALL_FILES[0]).exists() for name in SUITE)

    kept = check_request(record, request, overwrite)
    if begun() and not (kept or overwrite):
        raise FileExistsError(errno.EEXIST, EXISTS, str(home))
    try:
        write_request(record, request)
        yield kept
        remove_folder(record)
    finally:
        if not begun():
            remove_folder(record)


@contextmanager
def _folder(folder: Path) -> Iterator[Path]:
    """Make a folder unless it is there; it goes again if nothing is in it when the block ends."""
    if is_remote(folder):
        check_store(folder / ALL_FILES[0])
        yield folder
        return
    check_place(folder)
    was_there = folder.exists()
    folder.mkdir(exist_ok=True)
    try:
        yield folder
    finally:
        if not was_there:
            with suppress(OSError):
                folder.rmdir()


def merge_questions(
    tables: Sequence[QuestionsFile],
    out: str | Path,
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> None:
    """Write the tables of a question file, or of a set of shards, to one file.

    Args:
        tables: all of the file, as `open_tables` gives them.
        progress: called with the number of questions written since the last call.

    Raises as `sets.merge_file`, and FileFormatError for a released file.
    """
    first = tables[0]
    if first.spec is None or first.split is None:
        raise FileFormatError(first.path, "a released file", "one that iqtt make-split wrote")
    parts = [_stored_part(table, first.spec, first.split) for table in tables]
    compression = max(tables, key=len).compression()  # a table without rows has none
    merge_file(first.opened, out, parts, compression, overwrite, progress)


def _stored_part(table: QuestionsFile, spec: SplitSpec, split: str) -> Part:
    """Return the part of a split that a table holds; a file of images lacks some of its sheets."""
    part = split_part(spec, split, table.part, len(table), 0)
    columns = set(table.fields)
    sheets = [s for s in part.sheets if columns.issuperset(column.name for column in s.columns)]
    return replace(part, sheets=sheets, marks=())
