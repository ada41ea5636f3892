"""Questions without a file: endless batches of the rows that `iqtt make-split` would write."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, groupby
from typing import Any

from iqtt.files.layout import answer_column, question_columns, truth_columns
from iqtt.files.work import question_rows
from iqtt.questions.kinds import DISTRACTORS
from iqtt.questions.specs import SPLITS, QuestionSpec, SplitSpec
from iqtt.render import DEFAULT_BATCH, Source, groups, make_source, render_questions
from scenegen.common.names import check_choice
from scenegen.files.stream import (
    Columns,
    RowStream,
    chosen_columns,
    common_columns,
    requests_and_shares,
)
from scenegen.rendering.backend import select_variant
from scenegen.rendering.renderer import share_processors, stacked
from scenegen.rooms.make import check_batch

BLOCK = 1200  # questions whose right answers are balanced, beyond those of a file
PIXELS = 2**22  # that are rendered at once, unless a batch has more
ON_DEVICE = {"questions": "image", "depth": "depth"}  # columns that may stay there


class QuestionStream(RowStream):
    """Batches of questions, rendered during training.

    Row i is, bit for bit, question i of the file that `iqtt make-split` makes of the same request:
    in training, first the labelled and then the unlabelled questions. In each of these groups, and
    in each later block of 1,200 questions, the correct option is at all positions equally often.
    Names, types and units are those of the file's columns (`files.layout`).

        stream = iqtt.QuestionStream("matched", fields=("questions", "answers"), batch=64)
    """

    def __init__(
        self,
        kind_or_spec: "str | QuestionSpec | Mapping[str | QuestionSpec, float]",
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
        drop_last: bool = False,
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
        makers, asked, told = [], [], list[str]()
        kept = [n for n in ON_DEVICE if n in fields and on_device and variant != "scalar_rgb"]
        for request, share in requests_and_shares(kind_or_spec, QuestionSpec).items():
            if isinstance(request, str):
                check_choice("kind", request, DISTRACTORS)
            spec = SplitSpec(distractors=request) if isinstance(request, str) else request
            check_batch(batch, spec, images=1 + spec.answers)
            every = replace(spec, with_depth=True)
            known = [*question_columns(every), answer_column(), *truth_columns(every)]
            asked.append(chosen_columns(fields, known))
            common_columns(asked)  # before pools are made, which takes a second
            pools = make_source(replace(spec, with_depth="depth" in fields))
            told.append(f"{split} {spec.to_json()}")
            makers.append((partial(_rows, pools, split, asked[0], kept, device, batch), share))
        super().__init__(
            asked[0], makers, batch, start, stop, workers, rank, world_size,
            1, dict.fromkeys(kept, _stacked), drop_last, told,
        )  # fmt: skip


def _stacked(rows: list[Any], shape: tuple[int, ...]) -> Any:
    return stacked(list(chain.from_iterable(rows)), shape)


def _rows(
    pools: Source,
    split: str,
    fields: Columns,
    kept: Sequence[str],
    device: str,
    batch: int,
    numbers: list[int],
    processes: int,
) -> Iterator[dict[str, Any]]:
    """Yield questions, as a `stream.Maker`. Raises as `render_questions`."""
    share_processors(processes, device)
    spec, images = pools.spec, [ON_DEVICE[name] for name in kept]
    fitting = PIXELS // (spec.height * spec.width * (1 + spec.answers))
    how: dict[str, Any] = {"batch": min(DEFAULT_BATCH, max(batch, fitting))}
    for (first, count), some in groupby(numbers, partial(_block, spec, split)):
        rows = [number - first for number in some]
        for ready in render_questions(
            pools, split, first, count, rows=rows, device=device, kept=images, **how
        ):
            values = question_rows(spec, ready)
            for place in range(len(ready)):
                yield {name: values[name][place] for name in fields}


def _block(spec: QuestionSpec, split: str, number: int) -> tuple[int, int]:
    """Return first question and number of those with which a question's answer is balanced."""
    end = 0
    for first, count in groups(spec, split).values():
        end = first + count
        if number < end:
            return first, count
    return end + (number - end) // BLOCK * BLOCK, BLOCK
