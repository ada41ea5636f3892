"""Make the files of a split of questions, whole or in shards."""

import errno
import os
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from iqtt.files.layout import root_attributes
from iqtt.files.shards import (
    ALL_FILES,
    MANIFEST,
    SplitFiles,
    complete_split,
    file_tasks,
    is_own,
)
from iqtt.files.work import Work
from iqtt.questions.distractors import make_pools
from iqtt.questions.specs import SUITE, SplitSpec
from iqtt.questions.views import Tally
from iqtt.render import DEFAULT_BATCH
from scenegen.common.records import check
from scenegen.files.cluster import Cluster
from scenegen.files.new_file import EXISTS
from scenegen.files.new_folder import check_folder, folder_written_beside
from scenegen.files.places import as_place, check_store, is_remote
from scenegen.files.shards import MOST_SHARDS, opened
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
) -> Tally:
    """Write the files of a split to a folder; it appears when all of them are complete.

    Where one of them has more than `shard_size` questions, the folder is there from the start, and
    the same call goes on where an earlier one was killed.

    Seed and command would reveal the test answers, so only the file of the test answers has them.
    `new_folder.folder_written_beside` says how an older split is replaced.

    Args:
        batch: questions in one wavefront; bounds the memory, never changes a byte of the files.
        workers: processes that render, as in `rooms.make.make_dataset`.
        shard_size: files with more questions are cut into shards of so many, which the file shows
            as one.
        device, compression: as in `backend.DEVICES` and `table.COMPRESSIONS`.
        command: what to record as the command that made the files.
        secret: keep the seed out of the file of the test answers too.
        cluster: whose workers make the files; all of them must see the folder, or it is a URL.
        progress: is called with the number of questions that were written since the last call.

    Returns how many views were proposed and refused.

    Raises:
        SpecError, TooFewShapesError: a setting, before anything is rendered.
        PlacementError: the bounded search found no question that meets the spec.
        OSError: the folder, or the disk.
    """
    count = spec.train + spec.val + spec.test
    check(count > 0, "train, val and test", count, "at least 1 question in all")
    check(shard_size >= 1, "shard-size", shard_size, "at least 1")
    variant = select_variant(device)
    workers = workers or useful_workers(count * (1 + spec.answers), variant)
    place, tally = as_place(folder), Tally()
    least = -(-max(spec.train, spec.test, spec.val) // (MOST_SHARDS - 1))  # two parts of training
    check(least <= shard_size, "shard-size", shard_size, f"at least {least} for so many questions")
    tasks = file_tasks(spec, shard_size)
    in_shards = bool(cluster) or is_remote(place) or any(task.is_shard for task in tasks)
    if not is_remote(place):
        _check_folder(place, overwrite, in_shards)
    renderer = {"variant": variant, **versions()}
    public = root_attributes(spec.public(), renderer, "")
    private = root_attributes(spec.public() if secret else spec, renderer, command)
    work = Work(spec, make_pools(spec), batch, workers, device, compression)
    if in_shards:
        if not is_remote(place):
            place.mkdir(exist_ok=True)
        if cluster:
            place = place.absolute()  # workers are in other folders
        files = SplitFiles(place, work, public, private, shard_size)
        complete_split(
            files, tasks, tally,
            cluster=cluster, overwrite=overwrite, progress=progress,
        )  # fmt: skip
        return tally
    with folder_written_beside(place, _own_files(place), overwrite) as temporary:
        files = SplitFiles(temporary, work, public, private, shard_size)
        blocks = [block for task in tasks for block in task.blocks]
        with closing(work.in_order(blocks, tally)) as made:
            for task in tasks:
                files.write(task, made, progress)
            next(made, None)  # there is none; so workers end by themselves
    return tally


def _check_folder(folder: Path, overwrite: bool, in_shards: bool) -> None:
    """Raise OSError where a split cannot be written to a folder.

    One in shards may have been begun by an earlier run.
    """
    empty = folder.is_dir() and not any(folder.iterdir())
    begun = in_shards and (empty or (folder / MANIFEST).exists())
    check_folder(folder, _own_files(folder), overwrite or begun)


def _own_files(folder: Path) -> list[str]:
    """Return the names that files of a split have in a folder."""
    found = os.listdir(folder) if folder.is_dir() else []
    return [*ALL_FILES, *(name for name in found if is_own(name))]


def make_suite(
    folder: str | Path,
    spec: SplitSpec,
    *,
    overwrite: bool = False,
    **options: Any,
) -> Tally:
    """Write a split of each kind of questions to a folder of its own in `folder`: see `SUITE`.

    Each split is complete when it appears, and what could stop one of them is checked before the
    first one is made. Splits that an earlier run of the same request completed are kept.

    Args:
        spec: the settings of each split but its kind and number of answers.
        options: as for `make_split`.

    Raises as `make_split`.
    """
    specs = {
        name: replace(spec, distractors=kind, answers=answers)
        for name, (kind, answers) in SUITE.items()
    }
    home, device = as_place(folder), options.get("device", "auto")
    if is_remote(home):
        check_store(home / MANIFEST)
    waiting = {
        name: own
        for name, own in specs.items()
        if overwrite or not _is_made(home / name, own, device)
    }
    if not is_remote(home):
        for name in waiting if home.exists() else ():
            begun = (home / name / MANIFEST).exists()
            check_folder(home / name, _own_files(home / name), overwrite or begun)
    for own in waiting.values():
        make_pools(own)
    if waiting and not is_remote(home):
        home.mkdir(exist_ok=True)
    total, made = Tally(), 0
    try:
        for name, own in waiting.items():
            try:
                total.add(make_split(home / name, own, overwrite=overwrite, **options))
                made += 1
            except FileExistsError:  # in shards, and complete
                if overwrite or not (home / name / MANIFEST).exists():
                    raise
    finally:
        if not is_remote(home):
            with suppress(OSError):  # it stays if anything is in it
                home.rmdir()
    if not made:
        raise FileExistsError(errno.EEXIST, EXISTS, str(home))
    return total


def _is_made(folder: Path, spec: SplitSpec, device: str) -> bool:
    """Return whether an earlier run of the suite completed this split, without shards.

    Raises SpecError where another seed made it.
    """
    files = [folder / name for name in ALL_FILES]
    if (folder / MANIFEST).exists() or not all(file.is_file() for file in files):
        return False
    for path in files[:-1]:  # the last one may tell the seed
        with opened(path) as file:
            if file.attrs.get("spec") != spec.public().to_json():
                return False
    work = Work(spec, make_pools(spec), 1, 1, device, "gzip")
    size = spec.train + spec.val + spec.test
    SplitFiles(folder, work, {}, {}, size).confirm(file_tasks(spec, size))
    return True
