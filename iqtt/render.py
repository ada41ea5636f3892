"""Questions -> their images: batches in one wavefront, one question alone, the same bits."""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from iqtt.questions.sampling import Pools, answer_positions
from iqtt.questions.settle import Tally, settle
from iqtt.questions.specs import SplitSpec
from iqtt.questions.views import Question, pack_questions
from scenegen.rendering.ground_truth import visible_pixels
from scenegen.rendering.renderer import launch_fields

Array = NDArray[Any]
Fetch = Callable[[], dict[str, Array]]
DEFAULT_BATCH = 64  # questions in one wavefront
SETTLED = 512  # questions whose shapes and views are found together
FIRST_SETTLED = 16


@dataclass(frozen=True, eq=False)
class Rendered:
    """A question with its pixels.

    Attributes:
        images: reference and three answers, (4, H, W, 3), as the spec stores them.
        visible_pixels: that show each cube, (4, most cubes) int32.
        depth: planar, (4, H, W) float32, cube edges, NaN on the background; None unless the spec
            asks for it.
    """

    question: Question
    images: Array
    visible_pixels: Array
    depth: Array | None


def render_questions(
    spec: SplitSpec,
    pools: Pools,
    split: str,
    first: int,
    count: int,
    *,
    batch: int = DEFAULT_BATCH,
    device: str = "auto",
    tally: Tally | None = None,
) -> Iterator[list[Rendered]]:
    """Yield questions first .. first + count - 1 of a split in order, `batch` at a time.

    The positions of the right answers are balanced over just these questions.
    """
    tally = tally or Tally()
    places = answer_positions(spec, split, first, count)
    pending: tuple[list[Question], Fetch] | None = None
    # A few come first, so that a request that cannot be met ends soon.
    starts = [0, *range(min(FIRST_SETTLED, count), count, SETTLED), count]
    for start, stop in itertools.pairwise(starts):
        rows = range(start, stop)
        requests = [(first + i, int(places[i]), 0) for i in rows]
        settled = settle(spec, pools, split, requests, tally, device)
        for i in range(0, len(settled), batch):
            questions = settled[i : i + batch]
            following = questions, _launch(spec, questions, device)
            if pending is not None:
                yield _checked(spec, pools, split, *pending, tally, device)
            pending = following
    if pending is not None:
        yield _checked(spec, pools, split, *pending, tally, device)


def render_question(
    spec: SplitSpec, pools: Pools, split: str, index: int, device: str = "auto"
) -> Rendered:
    """Make one question of a split again, bit for bit as its file has it.

    Args:
        index: 0 up to the number of the split's questions; in training the unlabelled ones follow
            the labelled.

    Raises IndexError where the split has no such question.
    """
    for first, count in groups(spec, split).values():
        if first <= index < first + count:
            place = int(answer_positions(spec, split, first, count)[index - first])
            tally = Tally()
            questions = settle(spec, pools, split, [(index, place, 0)], tally, device)
            fetch = _launch(spec, questions, device)
            return _checked(spec, pools, split, questions, fetch, tally, device)[0]
    raise IndexError(f"{split} has {getattr(spec, split)} questions, none with index {index}")


def groups(spec: SplitSpec, split: str) -> dict[str, tuple[int, int]]:
    """Return first question and number of each HDF5 group of a split, by the group's name."""
    if split == "train":
        return {
            "labeled": (0, spec.labeled),
            "unlabeled": (spec.labeled, spec.train - spec.labeled),
        }
    return {"": (0, getattr(spec, split))}


def _launch(spec: SplitSpec, questions: Sequence[Question], device: str) -> Fetch:
    names = ("image", "object_id", "depth") if spec.with_depth else ("image", "object_id")
    return launch_fields(pack_questions(spec, questions), names, device)


def _checked(
    spec: SplitSpec,
    pools: Pools,
    split: str,
    questions: list[Question],
    fetch: Fetch,
    tally: Tally,
    device: str,
) -> list[Rendered]:
    """Wait for the images; questions whose full images hide a cube after all are made anew."""
    done = _rendered(spec, questions, fetch())
    while hidden := [i for i, one in enumerate(done) if not _shows_all(spec, one)]:
        requests = [
            (q.index, q.shapes.answer, q.attempt + 1) for q in (questions[i] for i in hidden)
        ]
        anew = settle(spec, pools, split, requests, tally, device)
        for i, one in zip(
            hidden, _rendered(spec, anew, _launch(spec, anew, device)()), strict=True
        ):
            questions[i], done[i] = one.question, one
    return done


def _rendered(
    spec: SplitSpec, questions: Sequence[Question], pixels: dict[str, Array]
) -> list[Rendered]:
    shown = visible_pixels(pixels["object_id"], spec.cubes[1])
    result = []
    for i, question in enumerate(questions):
        four = slice(4 * i, 4 * i + 4)
        depth = pixels["depth"][four] if spec.with_depth else None
        result.append(Rendered(question, pixels["image"][four], shown[four], depth))
    return result


def _shows_all(spec: SplitSpec, one: Rendered) -> bool:
    used = one.question.shapes.cubes.shape[1]
    return bool((one.visible_pixels[:, :used] >= spec.min_cube_pixels).all())
