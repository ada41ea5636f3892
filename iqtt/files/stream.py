"""Questions without a file: endless batches of the rows that `iqtt make-split` would write."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, groupby
from typing import Any

from iqtt.files.layout import answer_column, question_columns, truth_columns
from iqtt.files.work import question_rows
from iqtt.questions.distractors import Pools, make_pools
from iqtt.questions.specs import DISTRACTORS, SPLITS, SplitSpec
from iqtt.render import DEFAULT_BATCH, groups, render_questions
from scenegen.common.names import check_choice
from scenegen.files.schema import Column
from scenegen.files.stream import RowStream, check_fields, mixed
from scenegen.rendering.backend import select_variant
from scenegen.rendering.renderer import share_processors, stacked
from scenegen.rooms.make import check_batch

BLOCK = 1200  # questions whose right answers are balanced, beyond those of a file
ON_DEVICE = {"questions": "image", "depth": "depth"}  # columns that may stay there


class QuestionStream(RowStream):
    """Batches of questions, rendered while somebody learns from them.

    Row i is, bit for bit, question i of the file that `iqtt make-split` makes of the same request:
    in training the labelled ones, then the unlabelled ones. Each of these groups has its right
    answers at all positions equally often, and so has each block of 1,200 questions that follows.
    Names, types and units are those of the file's columns (`files.layout`).

        stream = iqtt.QuestionStream("matched", fields=("questions", "answers"), batch=64)
    """

    def __init__(
        self,
        kind_or_spec: "str | SplitSpec | Mapping[str | SplitSpec, float]",
        *,
        fields: Sequence[str] = ("questions", "answers"),
        batch: int = DEFAULT_BATCH,
        start: int = 0,
        stop: int | None = None,
        split: str = "train",
        device: str = "auto",
        workers: int = 0,
        rank: int | None = None,
        world_size: int | None = None,
        on_device: bool = False,
    ) -> None:
        """Take a kind of questions, a request, or several with the share of rows that each gets.

        Args:
            split: whose shapes are shown. No shape of training, nor its mirror image, is one of
                validation or test, whatever the seed.
            fields: columns of the file, `depth` too.

        The others, and what is raised, are as for `scenegen.RoomStream`; beside that, SpecError and
        TooFewShapesError as `make_pools`.
        """
        variant = select_variant(device)
        check_choice("split", split, SPLITS)
        requests, shares = mixed(kind_or_spec, SplitSpec)
        sources = []
        for request in requests:
            if isinstance(request, str):
                check_choice("kind", request, DISTRACTORS)
                request = SplitSpec(distractors=request)
            check_batch(batch, 1 + request.answers, request)
            spec = replace(request, with_depth="depth" in fields)
            every = replace(request, with_depth=True)
            known = [*question_columns(every), answer_column(), *truth_columns(every)]
            asked = check_fields(fields, known)
            kept = tuple(n for n in ON_DEVICE if n in asked and on_device and variant != "scalar_rgb")
            sources.append(QuestionSource(make_pools(spec), split, asked, kept, device))
        on = dict.fromkeys(sources[0].kept, _stacked)
        super().__init__(sources, shares, batch, start, stop, workers, rank, world_size, on)


def _stacked(rows: list[Any], shape: tuple[int, ...]) -> Any:
    return stacked(list(chain.from_iterable(rows)), shape)


@dataclass(frozen=True, eq=False)
class QuestionSource:
    """The questions of one request, as a `stream.Source`.

    Attributes:
        kept: columns that stay on the device.
    """

    pools: Pools
    split: str
    columns: Mapping[str, Column]
    kept: tuple[str, ...]
    device: str
    together = 1

    def rows(self, numbers: Sequence[int], processes: int) -> Iterator[dict[str, Any]]:
        """Yield questions by their numbers. Raises as `render_questions`."""
        share_processors(processes, self.device)
        kept = [ON_DEVICE[name] for name in self.kept]
        for (first, count), some in groupby(numbers, self._block):
            rows = [number - first for number in some]
            for ready in render_questions(
                self.pools, self.split, first, count, rows=rows, device=self.device, kept=kept
            ):
                values = question_rows(self.pools.spec, ready)
                for place in range(len(ready)):
                    yield {name: values[name][place] for name in self.columns}

    def _block(self, number: int) -> tuple[int, int]:
        """Return first question and number of those with which a question's answer is balanced."""
        end = 0
        for first, count in groups(self.pools.spec, self.split).values():
            end = first + count
            if number < end:
                return first, count
        return end + (number - end) // BLOCK * BLOCK, BLOCK
