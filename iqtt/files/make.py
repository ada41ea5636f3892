"""Make the files of a split: draw, render, pack and write questions, all at the same time."""

from collections.abc import Callable, Generator, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py

from iqtt.files.layout import root_attributes
from iqtt.files.writer import PackedQuestions, QuestionsWriter, pack_questions
from iqtt.questions.distractors import Pools, make_pools
from iqtt.questions.specs import SPLITS, SUITE, SplitSpec
from iqtt.questions.views import Tally
from iqtt.render import DEFAULT_BATCH, Rendered, groups, render_questions
from scenegen.common.hdf5.content import seal
from scenegen.common.hdf5.row_file import new_file
from scenegen.common.hdf5.table import packing_threads
from scenegen.common.new_folder import check_folder, folder_written_beside
from scenegen.common.records import check
from scenegen.common.workers.pool import in_processes, in_threads
from scenegen.rendering.backend import select_variant, versions
from scenegen.rendering.renderer import share_processors, useful_workers

FILES = ("iqtt-train.h5", "iqtt-val.h5", "iqtt-test.h5", "iqtt-test-answers.h5")
BLOCK = 128  # questions that a worker process makes in one go
PACKED = 8  # questions that a thread packs in one go


def make_split(
    folder: str | Path,
    spec: SplitSpec,
    *,
    batch: int = DEFAULT_BATCH,
    workers: int = 1,
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
        workers: processes that render, as in `rooms.make.make_dataset`.
        device, compression: as in `backend.DEVICES` and `table.COMPRESSIONS`.
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
    variant = select_variant(device)
    workers = workers or useful_workers(count * (1 + spec.answers), variant)
    with folder_written_beside(folder, FILES, overwrite) as temporary:
        renderer = {"variant": variant, **versions()}
        tally = Tally()
        public = root_attributes(spec.public(), renderer, "")
        private = root_attributes(spec.public() if secret else spec, renderer, command)
        work = _Work(spec, make_pools(spec), batch, workers, device, compression)
        made = work.in_blocks(tally) if workers > 1 else work.here(tally)

        def write(split: str, images_file: h5py.File, truth_file: h5py.File) -> None:
            for part, (_, count) in groups(spec, split).items():
                writer = QuestionsWriter(
                    images_file, truth_file, spec, split, part, count, compression
                )
                while writer.rows < count:
                    some = next(made)
                    writer.extend(some)
                    progress(some.count)
                writer.close()
            for file in {images_file, truth_file}:
                seal(file)

        with closing(made):
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
            next(made, None)  # there is none; so workers end by themselves
    return tally


@dataclass(frozen=True)
class _Block:
    """Some rows of a part of a split, which begins with question `first` and has `count`."""

    split: str
    part: str
    first: int
    count: int
    rows: range


@dataclass(frozen=True, eq=False)
class _Work:
    """What is done to questions, here or in another process."""

    spec: SplitSpec
    pools: Pools
    batch: int
    workers: int
    device: str
    compression: str

    def blocks(self, size: int) -> Iterator[_Block]:
        """Cut all parts of all splits into blocks of questions."""
        for split in SPLITS:
            for part, (first, count) in groups(self.spec, split).items():
                for start in range(0, count, size):
                    yield _Block(split, part, first, count, range(start, min(start + size, count)))

    def questions(self, block: _Block, tally: Tally) -> Generator[PackedQuestions]:
        """Render questions in order, and meanwhile pack them in threads."""
        rendered = render_questions(
            self.spec, self.pools, block.split, block.first, block.count,
            rows=block.rows, batch=self.batch, device=self.device, tally=tally,
        )  # fmt: skip
        pieces = (some[i : i + PACKED] for some in rendered for i in range(0, len(some), PACKED))

        def packed(questions: list[Rendered]) -> PackedQuestions:
            return pack_questions(self.spec, block.part, questions, self.compression)

        ahead = 2 * self.batch // PACKED
        return in_threads(packed, pieces, packing_threads(self.workers), ahead)

    def here(self, tally: Tally) -> Generator[PackedQuestions]:
        """Yield all questions, made in this process."""
        for block in self.blocks(self.spec.train + self.spec.val + self.spec.test):
            yield from self.questions(block, tally)

    def in_blocks(self, tally: Tally) -> Generator[PackedQuestions]:
        """Yield all questions, made by processes a block at a time."""
        for questions, found in in_processes(self.block, self.blocks(BLOCK), self.workers):
            tally.proposed += found.proposed
            tally.refused += found.refused
            yield from questions

    def block(self, block: _Block) -> tuple[list[PackedQuestions], Tally]:
        """Return the questions of a block; to be called by a worker."""
        share_processors(self.workers, self.device)
        tally = Tally()
        return list(self.questions(block, tally)), tally


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
