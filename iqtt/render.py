"""Images of questions: many in batches, or one question alone with the same bits."""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from iqtt.questions.distractors import Pools, answer_positions
from iqtt.questions.packing import Question, pack_questions
from iqtt.questions.specs import SplitSpec
from iqtt.questions.views import Tally, sample_questions
from scenegen.rendering.ground_truth import visible_pixels
from scenegen.rendering.renderer import launch_fields

Array = NDArray[Any]
Fetch = Callable[[], dict[str, Array]]
DEFAULT_BATCH = 64  # questions in one wavefront
SAMPLED = 512  # questions whose shapes and views are found together
FIRST_SAMPLED = 16  # the first ones are few, so that a request that cannot be met fails soon


@dataclass(frozen=True, eq=False)
class Rendered:
    """A question with its pixels.

    Attributes:
        images: reference and three answers, (4, H, W, 3), of the spec's `image_dtype`.
        visible_pixels: number of pixels that show each cube, (4, largest number of cubes) int32.
        depth: planar depth, (4, H, W) float32, cube edges, NaN on the background; None unless the
            spec asks for it.
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
    """Yield questions first .. first + count - 1 of a split in order, at most `batch` at a time.

    The positions of the right answers are balanced over just these questions.

    Raises PlacementError where the bounded search finds no question that meets the spec.
    """
    tally = tally or Tally()
    places = answer_positions(spec, split, first, count)
    pending: tuple[list[Question], Fetch] | None = None
    starts = [0, *range(min(FIRST_SAMPLED, count), count, SAMPLED), count]
    for start, stop in itertools.pairwise(starts):
        rows = range(start, stop)
        requests = [(first + i, int(places[i]), 0) for i in rows]
        sampled = sample_questions(spec, pools, split, requests, tally, device)
        for i in range(0, len(sampled), batch):
            questions = sampled[i : i + batch]
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
        index: its number in the split, from 0; in training the unlabelled questions follow the
            labelled ones.

    Raises IndexError where the split has no such question.
    """
    for first, count in groups(spec, split).values():
        if first <= index < first + count:
            place = int(answer_positions(spec, split, first, count)[index - first])
            tally = Tally()
            questions = sample_questions(spec, pools, split, [(index, place, 0)], tally, device)
            fetch = _launch(spec, questions, device)
            return _checked(spec, pools, split, questions, fetch, tally, device)[0]
    raise IndexError(f"{split} has {getattr(spec, split)} questions, none with index {index}")


def groups(spec: SplitSpec, split: str) -> dict[str, tuple[int, int]]:
    """Return for each HDF5 group of a split its first question and their number."""
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
    """Wait for the images; make questions anew whose full images hide a cube after all."""
    done = _rendered(spec, questions, fetch())
    while hidden := [i for i, one in enumerate(done) if not _shows_all(spec, one)]:
        requests = [
            (q.index, q.shapes.answer, q.attempt + 1) for q in (questions[i] for i in hidden)
        ]
        anew = sample_questions(spec, pools, split, requests, tally, device)
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
