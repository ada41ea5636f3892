"""Make the files of a split of questions, or of a suite of splits; merge shards to one file."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from iqtt.files.reader import QuestionsFile
from iqtt.files.split import split_files, split_part, split_request
from iqtt.files.work import QuestionsWork
from iqtt.perspective.specs import SUITE as ROOM_SUITE
from iqtt.perspective.specs import PerspectiveSpec
from iqtt.questions.specs import SUITE, QuestionSpec
from iqtt.questions.views import Tally
from iqtt.render import DEFAULT_BATCH, make_source
from scenegen.common.errors import FileFormatError
from scenegen.common.records import check
from scenegen.files.new_file import check_place
from scenegen.files.places import as_place, is_remote
from scenegen.files.sets.cluster import Cluster
from scenegen.files.sets.making import make_set
from scenegen.files.sets.plan import Part
from scenegen.files.sets.sets import merge_file
from scenegen.rendering.backend import select_variant, versions
from scenegen.rendering.renderer import useful_workers

SHARD_SIZE = 10_000  # questions


def make_split(
    folder: str | Path,
    spec: QuestionSpec,
    *,
    suite: bool = False,
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
) -> Tally:
    """Write the files of a split to a folder, where they appear when all are complete.

    The same call resumes an interrupted one. Seed and command would reveal the answer key of the
    test questions, so only the file of the answer key stores them.

    Args:
        folder: is made if it is not there; other files in it are left alone.
        suite: write one split per distractor type to sub-folders of `folder`, with the settings of
            `spec` except distractor type and number of options: see `SUITE`.
        batch: questions in one wavefront; bounds the memory, never changes a byte of the files.
        workers: processes that render, as in `rooms.make.make_dataset`.
        shard_size: maximum number of questions per file; larger files are split into shards that
            read as one file.
        device, compression: as in `backend.DEVICES` and `table.COMPRESSIONS`.
        overwrite: replace older files of a split.
        command: what to record as the command that made the files.
        secret: store the seed in no file, not even in the answer key.
        cluster: whose workers make the files; all of them must see the folder, or it is a URL.
        progress: is called with the number of questions that were written since the last call.

    Returns how many views were sampled and rejected.

    Raises:
        SpecError, TooFewShapesError: a setting, before anything is rendered.
        PlacementError: the bounded search found no question that meets the spec.
        OSError, SceneGenError: as `making.make_set`.
    """
    splits = {"": spec}
    if suite:
        splits = {
            name: replace(spec, distractors=kind, answers=answers)
            for name, (kind, answers) in suite_of(spec).items()
        }
    count = spec.train + spec.val + spec.test
    check(count > 0, "train, val and test", count, "at least 1 question in all")
    variant = select_variant(device)
    renderer = {"variant": variant, **versions()}
    files = [
        file
        for name, of_split in splits.items()
        for file in split_files(of_split, renderer, command, secret, name)
    ]
    images = len(splits) * count * (1 + spec.answers)
    tally = Tally()
    with _folder(as_place(folder), splits) as place:
        pools = {name: make_source(of_split) for name, of_split in splits.items()}
        work = QuestionsWork(pools, batch, device, compression)
        make_set(
            place, files, split_request(spec, renderer, secret), work, shard_size,
            workers=workers or useful_workers(images, variant, work.worthwhile),
            cluster=cluster, overwrite=overwrite, progress=progress, note=tally.add,
        )  # fmt: skip
    return tally


def suite_of(spec: QuestionSpec) -> dict[str, tuple[str, int]]:
    """Return the splits of a suite: folder, kind of questions, and number of answers."""
    return ROOM_SUITE if isinstance(spec, PerspectiveSpec) else SUITE


@contextmanager
def _folder(folder: Path, names: Iterable[str]) -> Iterator[Path]:
    """Make a folder unless it is there; it goes again if nothing is in it when the block ends.

    Raises OSError where folders of these names cannot be in it.
    """
    if is_remote(folder):
        yield folder
        return
    check_place(folder)
    was_there = folder.exists()
    folder.mkdir(exist_ok=True)
    try:
        for name in names:
            check_place(folder / name)
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


def _stored_part(table: QuestionsFile, spec: QuestionSpec, split: str) -> Part:
    """Return the part of a split that a table holds; a file of images lacks some of its sheets."""
    part = split_part(spec, split, table.part, len(table), 0)
    columns = set(table.fields)
    sheets = [s for s in part.sheets if columns.issuperset(column.name for column in s.columns)]
    return replace(part, sheets=sheets, marks=())
