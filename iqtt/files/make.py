"""Make the files of a split: draw, render and write questions, the three at the same time."""

from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py

from iqtt.files.layout import root_attributes
from iqtt.files.writer import QuestionsWriter
from iqtt.questions.distractors import make_pools
from iqtt.questions.specs import SUITE, SplitSpec
from iqtt.questions.views import Tally
from iqtt.render import DEFAULT_BATCH, Rendered, groups, render_questions
from scenegen.common.hdf5.content import seal
from scenegen.common.hdf5.row_file import new_file
from scenegen.common.new_folder import check_folder, folder_written_beside
from scenegen.common.records import check
from scenegen.rendering.backend import select_variant, versions

FILES = ("iqtt-train.h5", "iqtt-val.h5", "iqtt-test.h5", "iqtt-test-answers.h5")
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
    secret: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> Tally:
    """Write the files of a split to a folder; it appears when all of them are complete.

    Seed and command would reveal the test answers, so only the file of the test answers has them.
    `new_folder.folder_written_beside` says how an older split is replaced.

    Args:
        batch: questions in one wavefront; bounds the memory, never changes a byte of the files.
        device, compression: as in `backend.DEVICES` and `row_file.COMPRESSIONS`.
        command: what to record as the command that made the files.
        secret: keep the seed out of the file of the test answers too.
        progress: is called with the number of questions that were written since the last call.

    Returns how many views were proposed and refused.

    Raises:
        SpecError, TooFewShapesError: a setting, before anything is rendered.
        PlacementError: the bounded search found no question that meets the spec.
        OSError: the folder, or the disk.
    """
    count = spec.train + spec.val + spec.test
    check(count > 0, "train, val and test", count, "at least 1 question in all")
    with folder_written_beside(folder, FILES, overwrite) as temporary:
        renderer = {"variant": select_variant(device), **versions()}
        pools, tally = make_pools(spec), Tally()
        public = root_attributes(spec.public(), renderer, "")
        private = root_attributes(spec.public() if secret else spec, renderer, command)

        def write(split: str, images_file: h5py.File, truth_file: h5py.File) -> None:
            for part, (first, count) in groups(spec, split).items():
                writer = QuestionsWriter(
                    images_file, truth_file, spec, split, part, count, compression
                )
                rendered = render_questions(
                    spec, pools, split, first, count, batch=batch, device=device, tally=tally
                )
                _append_all(writer, rendered, progress)
                writer.close()
            for file in {images_file, truth_file}:
                seal(file)

        for split in ("train", "val"):
            with new_file(temporary / f"iqtt-{split}.h5") as file:
                file.attrs.update({**public, "split": split})
                write(split, file, file)
        with (
            new_file(temporary / "iqtt-test.h5") as test,
            new_file(temporary / "iqtt-test-answers.h5") as answers,
        ):
            test.attrs.update({**public, "split": "test"})
            answers.attrs.update({**private, "split": "test"})
            write("test", test, answers)
    return tally


def make_suite(
    folder: str | Path,
    spec: SplitSpec,
    *,
    overwrite: bool = False,
    **options: Any,
) -> Tally:
    """Write a split of each kind of questions to a folder of its own in `folder`: see `SUITE`.

    Each split is complete when it appears, and what could stop one of them is checked before the
    first one is made.

    Args:
        spec: the settings of each split but its kind and number of answers.
        options: as for `make_split`.

    Raises as `make_split`.
    """
    specs = {
        name: replace(spec, distractors=kind, answers=answers)
        for name, (kind, answers) in SUITE.items()
    }
    home = Path(folder)
    if home.exists():
        for name in specs:
            check_folder(home / name, FILES, overwrite)
    for own in specs.values():
        make_pools(own)
    home.mkdir(exist_ok=True)
    total = Tally()
    try:
        for name, own in specs.items():
            tally = make_split(home / name, own, overwrite=overwrite, **options)
            total.proposed += tally.proposed
            total.refused += tally.refused
    finally:
        with suppress(OSError):  # it stays if anything is in it
            home.rmdir()
    return total


def _append_all(
    writer: QuestionsWriter, batches: Iterable[list[Rendered]], progress: Callable[[int], Any]
) -> None:
    """Write batches in a thread of its own, while the next ones are rendered."""
    with ThreadPoolExecutor(1) as pool:
        writing: deque[Future[int]] = deque()
        for rendered in batches:
            writing.append(pool.submit(writer.append, rendered))
            if len(writing) > MOST_WAITING:
                progress(writing.popleft().result())
        while writing:
            progress(writing.popleft().result())
