"""Questions -> images -> the files of a split."""

import errno
import hashlib
import os
import shutil
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from iqtt.files.layout import (
    question_columns,
    root_attributes,
    truth_attributes,
    truth_columns,
)
from iqtt.files.truth_rows import truth_rows
from iqtt.questions.sampling import Pools, make_pools
from iqtt.questions.settle import Tally
from iqtt.questions.specs import SplitSpec
from iqtt.render import DEFAULT_BATCH, Rendered, groups, render_questions
from scenegen.common.new_file import check_writable
from scenegen.common.row_file import Table, new_file
from scenegen.rendering.backend import select_variant

FILES = ("iqtt-train.h5", "iqtt-val.h5", "iqtt-test.h5", "iqtt-test-answers.h5")
FINGERPRINTED = ("cubes", "world_from_shape", "light_position", "light_color")
MOST_WAITING = 2  # batches that may wait to be written


def make_split(
    folder: str | Path,
    spec: SplitSpec,
    *,
    batch: int = DEFAULT_BATCH,
    device: str = "auto",
    overwrite: bool = False,
    compression: str = "gzip",
    command: str = "",
    progress: Callable[[int], Any] = lambda done: None,
) -> Tally:
    """Write the files of a split to a folder, where they appear when all of them are complete.

    Seed and command would tell the test answers, so they are kept with those only.

    Returns how many views were proposed and refused.

    Raises:
        SpecError, TooFewShapesError: the request; before anything is rendered.
        PlacementError: the bounded search found no question that meets it.
        OSError: the folder, or the disk.
    """
    folder = Path(folder)
    _check_folder(folder, overwrite)
    variant = select_variant(device)
    run = _Run(spec, make_pools(spec), batch, device, compression, progress)
    public = root_attributes(spec.public(), variant, "")
    private = root_attributes(spec, variant, command)
    temporary = (folder if folder.is_dir() else folder.parent) / f".iqtt-{os.getpid()}.partial"
    temporary.mkdir()
    try:
        for split in ("train", "val"):
            with new_file(temporary / f"iqtt-{split}.h5") as file:
                file.attrs.update({**public, "split": split})
                for group in groups(spec, split):
                    _write_table(run, split, group, file, file)
        with (
            new_file(temporary / "iqtt-test.h5") as test,
            new_file(temporary / "iqtt-test-answers.h5") as answers,
        ):
            test.attrs.update({**public, "split": "test"})
            answers.attrs.update({**private, "split": "test"})
            _write_table(run, "test", "", test, answers)
        _check_folder(folder, overwrite, temporary.name)
        if folder.is_dir():
            for name in FILES:
                os.replace(temporary / name, folder / name)
        else:
            os.replace(temporary, folder)
    except OSError as error:
        told = Path(str(error.filename))
        if told.parent != temporary:
            raise
        raise OSError(error.errno, error.strerror, str(folder / told.name)) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return run.tally


@dataclass(frozen=True, eq=False)
class _Run:
    """What all tables of a split share."""

    spec: SplitSpec
    pools: Pools
    batch: int
    device: str
    compression: str
    progress: Callable[[int], Any]
    tally: Tally = field(default_factory=Tally)


def _write_table(
    run: _Run, split: str, group: str, images_file: h5py.File, truth_file: h5py.File
) -> None:
    """Write the questions of an HDF5 group to one file, what is known of them to another."""
    spec = run.spec
    first, count = groups(spec, split)[group]
    known = truth_file.require_group(f"truth/{group}")
    known.attrs.update(truth_attributes(spec))
    into = images_file.require_group(group or "/")
    images = Table(into, question_columns(spec), count, run.compression)
    truth = Table(known, truth_columns(spec), count, run.compression)
    digest = hashlib.sha256(f"{spec.public().to_json()} {split} {group}".encode())
    answers = np.zeros(count, np.uint8)

    def write(rendered: Sequence[Rendered]) -> int:
        for one, row in zip(rendered, truth_rows(spec, rendered), strict=True):
            answers[images.rows] = one.question.shapes.answer
            for name in FINGERPRINTED:
                digest.update(np.ascontiguousarray(row[name]).tobytes())
            digest.update(bytes([one.question.shapes.answer]))
            images.append({"questions": one.images})
            truth.append(row)
        return len(rendered)

    with ThreadPoolExecutor(1) as pool:
        writing: deque[Future[int]] = deque()
        for rendered in render_questions(
            spec,
            run.pools,
            split,
            first,
            count,
            batch=run.batch,
            device=run.device,
            tally=run.tally,
        ):
            writing.append(pool.submit(write, rendered))
            if len(writing) > MOST_WAITING:
                run.progress(writing.popleft().result())
        while writing:
            run.progress(writing.popleft().result())
    if group != "unlabeled":
        dataset = truth_file.require_group(group or "/").create_dataset("answers", data=answers)
        dataset.attrs["meaning"] = "which of images 1 to 3 shows the reference's shape, from 0"
    name = f"fingerprint_{group}" if group else "fingerprint"
    for file in (images_file, truth_file):
        file.attrs[name] = digest.hexdigest()


def _check_folder(folder: Path, overwrite: bool, own: str = "") -> None:
    """Raise the OSError that would end in a lost run; `own` is a name in the folder to ignore."""
    if not folder.is_dir():
        if folder.is_symlink() and not folder.exists():
            raise FileNotFoundError(errno.ENOENT, "is a link to nothing", str(folder))
        if folder.exists():
            raise NotADirectoryError(errno.ENOTDIR, "is a file; name a folder", str(folder))
        check_writable(folder, overwrite)
        return
    if not overwrite:
        text = "exists already; say --overwrite to replace it"
        raise FileExistsError(errno.EEXIST, text, str(folder))
    ours = {own, *(name for name in FILES if (folder / name).is_file())}
    strangers = sorted(set(os.listdir(folder)) - ours)
    if strangers:
        raise FileExistsError(errno.EEXIST, f"holds other files too ({strangers[0]})", str(folder))
    if not os.access(folder, os.W_OK):
        raise PermissionError(errno.EACCES, "cannot be written to", str(folder))
