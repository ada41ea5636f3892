"""Blocks of questions: drawn, rendered and packed, all at the same time, here or by processes."""

from collections.abc import Generator, Iterable
from dataclasses import dataclass, replace

from iqtt.files.writer import PackedQuestions, pack_questions
from iqtt.questions.distractors import Pools
from iqtt.questions.specs import SplitSpec
from iqtt.questions.views import Tally
from iqtt.render import Rendered, groups, render_questions
from scenegen.files.cluster import threads_of_worker
from scenegen.files.table import packing_threads
from scenegen.files.workers import in_processes, in_threads, processors
from scenegen.rendering.renderer import share_processors

BLOCK = 128  # questions that a worker process makes in one go
PACKED = 8  # questions that a thread packs in one go


@dataclass(frozen=True)
class Block:
    """Some rows of a part of a split, which begins with question `first` and has `count`."""

    split: str
    part: str
    first: int
    count: int
    rows: range


def whole_parts(spec: SplitSpec, split: str) -> list[Block]:
    """Return a block for each part of a split, also for one without questions."""
    parts = groups(spec, split).items()
    return [Block(split, part, first, count, range(count)) for part, (first, count) in parts]


@dataclass(frozen=True, eq=False)
class Work:
    """What is done to questions, here or in other processes.

    Attributes:
        spec, pools: what they show.
        batch: questions rendered at once.
        workers: processes that render.
        device, compression: as in `backend.DEVICES` and `table.COMPRESSIONS`.
    """

    spec: SplitSpec
    pools: Pools
    batch: int
    workers: int
    device: str
    compression: str

    def questions(self, block: Block, tally: Tally) -> Generator[PackedQuestions]:
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

    def in_order(self, blocks: Iterable[Block], tally: Tally) -> Generator[PackedQuestions]:
        """Yield the questions of all blocks, made here or by processes."""
        filled = (block for block in blocks if block.rows)
        if self.workers == 1:
            for block in filled:
                yield from self.questions(block, tally)
            return
        small = (
            replace(block, rows=block.rows[i : i + BLOCK])
            for block in filled
            for i in range(0, len(block.rows), BLOCK)
        )
        for questions, found in in_processes(self.block, small, self.workers):
            tally.add(found)
            yield from questions

    def block(self, block: Block) -> tuple[list[PackedQuestions], Tally]:
        """Return the questions of a block; to be called by a worker."""
        self.prepare()
        tally = Tally()
        return list(self.questions(block, tally)), tally

    def prepare(self) -> None:
        """Get a worker ready: it takes its share of the processors."""
        share_processors(self.workers, self.device)

    def on_cluster(self) -> "Work":
        """Return the same work for the worker of a cluster that calls this, and get it ready."""
        work = replace(self, workers=max(1, processors() // threads_of_worker()))
        work.prepare()
        return work
