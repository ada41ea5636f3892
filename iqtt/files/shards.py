"""The files of a split, whole or in shards: how they are cut, written, and shown as one."""

import time
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from iqtt.files.layout import FORMAT_NAME, FORMAT_VERSION, truth_attributes
from iqtt.files.work import Block, Work, whole_parts
from iqtt.files.writer import (
    FINGERPRINTED,
    Fingerprint,
    PackedQuestions,
    QuestionsWriter,
    write_identity,
)
from iqtt.questions.specs import SPLITS, SplitSpec
from iqtt.questions.views import Tally
from iqtt.render import render_question
from scenegen.files.cluster import Cluster
from scenegen.files.content import seal
from scenegen.files.making import Task, check_shared, complete_set, other_request, record_file
from scenegen.files.manifest import FORMAT, Manifest, ShardRecord
from scenegen.files.row_file import new_file, writer_name
from scenegen.files.shards import (
    ROW_DIGESTS,
    Shard,
    cut,
    opened,
    set_name,
    shard_name,
)
from scenegen.files.virtual import write_list, write_virtual
from scenegen.rendering.backend import VERSION_ATTRIBUTES

ANSWERS = "iqtt-test-answers.h5"
FILES = {
    "train": ("iqtt-train.h5",),
    "val": ("iqtt-val.h5",),
    "test": ("iqtt-test.h5", ANSWERS),
}  # of images, and of what is known of the questions
ALL_FILES = tuple(name for split in SPLITS for name in FILES[split])
MANIFEST = "iqtt.manifest.json"


@dataclass(frozen=True)
class FileTask(Task):
    """Files of a split that are made together.

    Attributes:
        blocks: the questions that they hold, of each part.
        is_shard: whether they hold some of the questions of one part.
    """

    blocks: tuple[Block, ...]
    is_shard: bool


def is_own(name: str) -> bool:
    """Return whether a file of this name in a folder of questions is one that is written here."""
    return name in (MANIFEST, f".{MANIFEST}.lock", *ALL_FILES) or set_name(name) in ALL_FILES


def file_tasks(spec: SplitSpec, size: int) -> list[FileTask]:
    """Return the files of a split, those with more than `size` questions in shards.

    A shard has questions of one part, and the file of the split's questions as many shards as that
    of their answers.
    """
    tasks = []
    for split in SPLITS:
        files, parts = FILES[split], whole_parts(spec, split)
        total = sum(part.count for part in parts)
        if total <= size:
            tasks.append(FileTask(files, 0, total, tuple(parts), False))
            continue
        blocks = [
            Block(split, part.part, part.first, part.count, rows)
            for part in parts
            for rows in cut(part.count, size)
        ]
        for i, block in enumerate(blocks):
            names = tuple(shard_name(file, i, len(blocks)) for file in files)
            first = block.first + block.rows.start
            tasks.append(FileTask(names, first, len(block.rows), (block,), True))
    return tasks


@dataclass(frozen=True, eq=False)
class SplitFiles:
    """How the files of a split are written; any process can write any of them.

    Attributes:
        folder: where they go.
        public, private: root attributes of files that are handed out, and of the file of the
            answers to the test.
        size: largest number of questions in a file.
    """

    folder: Path
    work: Work
    public: dict[str, Any]
    private: dict[str, Any]
    size: int

    @property
    def asked(self) -> Manifest:
        """The manifest of the request, which tells no seed and no command."""
        secret = "yes" if self.private["spec"] == self.public["spec"] else "no"
        names = ("variant", *VERSION_ATTRIBUTES)
        settings = {"compression": self.work.compression, "format_version": FORMAT_VERSION}
        settings |= {"writer": writer_name(), "secret-seed": secret}
        settings |= {name: self.public[name] for name in names}
        spec, told = self.work.spec, tuple(sorted(settings.items()))
        count = spec.train + spec.val + spec.test
        return Manifest(
            FORMAT, FORMAT_NAME, ALL_FILES, spec.public().to_json(), count, self.size, told, "",
            False, (),
        )  # fmt: skip

    def of_run(self, manifest: Manifest) -> "SplitFiles":
        """Return the same files with the command that complete files of answers tell, if any."""
        for shard in manifest.shards_of(ANSWERS):
            with opened(self.folder / shard.file) as file:
                command = str(file.attrs.get("creation_command", ""))
            return replace(self, private={**self.private, "creation_command": command})
        return self

    def write(
        self,
        task: FileTask,
        made: Generator[PackedQuestions],
        progress: Callable[[int], Any] = lambda done: None,
    ) -> list[ShardRecord]:
        """Write the files of a task with the next questions of `made`."""
        started, spec, split = time.monotonic(), self.work.spec, task.blocks[0].split
        with ExitStack() as stack:
            files = [
                stack.enter_context(new_file(self.folder / name, overwrite=True))
                for name in task.names
            ]
            for file, name in zip(files, FILES[split], strict=True):
                file.attrs.update(self._attributes(name, split))
            for block in task.blocks:
                count = len(block.rows)
                writer = QuestionsWriter(
                    files[0], files[-1], spec, split, block.part, count, self.work.compression,
                    is_shard=task.is_shard,
                )  # fmt: skip
                while writer.rows < count:
                    some = next(made)
                    writer.extend(some)
                    progress(some.count)
                writer.close()
            for file in files:
                seal(file)
        rows = sum(len(block.rows) for block in task.blocks)
        return [record_file(self.folder / name, task, rows, started) for name in task.names]

    def elsewhere(self, task: FileTask) -> tuple[list[ShardRecord], Tally]:
        """Write the files of a task; to be called by a worker of a cluster."""
        check_shared(self.folder / MANIFEST, self.asked)
        work = self.work.on_cluster()
        tally = Tally()
        made = (some for block in task.blocks for some in work.questions(block, tally))
        return self.write(task, made), tally

    def join(self, manifest: Manifest) -> None:
        """Write the files that show shards as one; they tell what whole files would tell."""
        spec = self.work.spec
        parts = {
            task.names[-1]: task.blocks[0]
            for task in file_tasks(spec, manifest.shard_size)
            if task.is_shard
        }
        for split in SPLITS:
            known = FILES[split][-1]
            shards = [one for one in manifest.shards_of(known) if one.file in parts]
            if not shards:
                continue
            marks = {
                block.part: Fingerprint(spec, split, block.part)
                for block in whole_parts(spec, split)
            }
            for shard in shards:
                part = parts[shard.file].part
                with opened(self.folder / shard.file) as file:
                    _add_stored(marks[part], file[f"truth/{part}"])
            of_part = [parts[shard.file].part for shard in shards]
            for name in FILES[split]:
                told = zip(manifest.shards_of(name), of_part, strict=True)
                listed = [Shard(one.file, one.rows, one.content_digest, p) for one, p in told]
                self._show(split, name, listed, marks)

    def _show(
        self, split: str, name: str, shards: Sequence[Shard], marks: dict[str, Fingerprint]
    ) -> None:
        spec, has_truth = self.work.spec, name == FILES[split][-1]
        with new_file(self.folder / name, overwrite=True) as file:
            file.attrs.update(self._attributes(name, split))
            for part, mark in marks.items():
                some = [shard for shard in shards if shard.part == part]
                if not some:  # of training, where all or none of the questions have answers
                    QuestionsWriter(file, file, spec, split, part, 0, self.work.compression).close()
                    continue
                if has_truth:
                    file.require_group(f"truth/{part}").attrs.update(truth_attributes(spec))
                with opened(self.folder / some[0].file) as first:
                    names = first[ROW_DIGESTS].attrs["names"]
                write_virtual(file, self.folder, some, dict.fromkeys(names))
                write_identity(file, part, mark, has_truth)
            write_list(file, shards)
            seal(file)

    def _attributes(self, name: str, split: str) -> dict[str, Any]:
        return {**(self.private if name == ANSWERS else self.public), "split": split}

    def confirm(self, kept: Sequence[FileTask]) -> None:
        """Make one question of each split again, the first one of files that are kept.

        The seed is neither in the manifest nor in the file of the questions. Raises SpecError where
        another seed made them.
        """
        first: dict[str, tuple[FileTask, Block]] = {}
        for task in kept:
            for block in task.blocks:
                if block.rows:
                    first.setdefault(block.split, (task, block))
        for task, block in first.values():
            self._confirm(task, block)

    def _confirm(self, task: FileTask, block: Block) -> None:
        row = block.first + block.rows.start
        work = self.work
        question = render_question(work.spec, work.pools, block.split, row, work.device).question
        place = self.folder / task.names[-1]
        with opened(place) as file:
            stored = file[f"truth/{block.part}"]
            cubes = stored["cubes"][0][:, : int(stored["cube_count"][0])]
            turned = stored["world_from_shape"][0]
        if not (
            np.array_equal(cubes, question.shapes.cubes)
            and np.array_equal(turned, question.world_from_shape)
        ):
            raise other_request(place, "questions of another seed")


def _add_stored(mark: Fingerprint, truth: h5py.Group) -> None:
    columns = [truth[name][()] for name in FINGERPRINTED]
    answers = (truth["distractor_kind"][()] == -1).argmax(axis=1).astype(np.uint8)
    for row in zip(*columns, answers, strict=True):
        mark.add(b"".join(value.tobytes() for value in row))


def complete_split(
    files: SplitFiles,
    tasks: Sequence[FileTask],
    tally: Tally,
    *,
    cluster: Cluster | None,
    overwrite: bool,
    progress: Callable[[int], Any],
) -> None:
    """Make the files of a split that earlier runs of the same request have not made.

    Args:
        tally: gets what is proposed now.
        cluster: whose workers make the files; None for processes of this machine.

    Raises as `complete_set`.
    """
    work = files.work

    def make(manifest: Manifest, missing: Sequence[FileTask]) -> Generator[list[ShardRecord]]:
        own = files.of_run(manifest)
        if cluster is None:
            blocks = [block for task in missing for block in task.blocks]
            with closing(work.in_order(blocks, tally)) as made:
                for task in missing:
                    yield own.write(task, made, progress)
                next(made, None)  # there is none; so workers end by themselves
            return
        for records, found in cluster.in_any_order(own.elsewhere, missing):
            tally.add(found)
            progress(records[0].rows)
            yield records

    complete_set(
        files.folder / MANIFEST, files.asked, tasks, make,
        lambda manifest: files.of_run(manifest).join(manifest),
        overwrite=overwrite, confirm=files.confirm, progress=progress,
    )  # fmt: skip
