"""Images of questions: many in batches, or one question alone with the same bits."""

import itertools
from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from numpy.typing import NDArray

from iqtt.perspective.rooms import RenderedRooms, Rooms, make_rooms, render_rooms
from iqtt.perspective.specs import PerspectiveSpec
from iqtt.questions.distractors import Pools, answer_positions, make_pools
from iqtt.questions.packing import Question, pack_questions
from iqtt.questions.specs import QuestionSpec, SplitSpec
from iqtt.questions.views import Tally, sample_questions
from scenegen.rendering.ground_truth import KEPT, visible_pixels
from scenegen.rendering.renderer import launch_fields

Array = NDArray[Any]
DEFAULT_BATCH = 64  # questions in one wavefront
SAMPLED = 128  # questions whose shapes and views are found together
AHEAD = 2  # batches that are rendered meanwhile
FIRST_SAMPLED = 16  # the first ones are few, so that a request that cannot be met fails soon


@dataclass(frozen=True, eq=False)
class Rendered:
    """A question with its pixels.

    Attributes:
        images: reference and K answers, (1 + K, H, W, 3), of the spec's `image_dtype`.
        visible_pixels: pixels that show each cube, (1 + K, largest number of cubes) int32.
        depth: planar depth, (1 + K, H, W) float32, cube edges, NaN on the background; None unless
            the spec asks for it.
    """

    question: Question
    images: Array
    visible_pixels: Array
    depth: Array | None


Fetch: TypeAlias = Callable[[], list[Rendered]]
Source: TypeAlias = Pools | Rooms
"""What questions are drawn from."""


def make_source(spec: QuestionSpec) -> Source:
    """Return what questions are drawn from. Raises as `make_pools` and `make_rooms`."""
    if isinstance(spec, PerspectiveSpec):
        return make_rooms(spec)
    assert isinstance(spec, SplitSpec)
    return make_pools(spec)


def render_questions(
    source: Source,
    split: str,
    first: int,
    count: int,
    *,
    rows: Sequence[int] | None = None,
    batch: int = DEFAULT_BATCH,
    device: str = "auto",
    tally: Tally | None = None,
    kept: Collection[str] = (),
) -> Iterator[list[Rendered] | list[RenderedRooms]]:
    """Yield questions first .. first + count - 1 of a split in order, at most `batch` at a time.

    The positions of the right answers are balanced over just these questions. Of these, only `rows`
    are made where they are given, which ascend; 0 is the first of them. Of image and depth, those
    that are `kept` stay on the device, as in `renderer.launch_fields`.

    Raises PlacementError where the bounded search finds no question that meets the spec.
    """
    tally, rows = tally or Tally(), range(count) if rows is None else rows
    places = answer_positions(source.spec, split, first, count)
    if isinstance(source, Rooms):
        asked = [(first + i, int(places[i])) for i in rows]
        yield from ([one] for one in render_rooms(source, split, asked, tally, device))
        return
    pools, spec = source, source.spec
    pending = deque[Fetch]()
    few = SAMPLED if rows and rows[0] else FIRST_SAMPLED
    starts = [0, *range(min(few, len(rows)), len(rows), SAMPLED), len(rows)]
    for start, stop in itertools.pairwise(starts):
        requests = [(first + i, int(places[i]), 0) for i in rows[start:stop]]
        sampled = sample_questions(pools, split, requests, tally)
        for i in range(0, len(sampled), batch):
            pending.append(_launch(spec, sampled[i : i + batch], device, kept))
            if len(pending) > AHEAD:
                yield _checked(pools, split, pending.popleft()(), tally, device, kept)
    while pending:
        yield _checked(pools, split, pending.popleft()(), tally, device, kept)


def render_question(
    source: Source, split: str, index: int, device: str = "auto"
) -> Rendered | RenderedRooms:
    """Make one question of a split again, bit for bit as its file has it.

    Args:
        index: its number in the split, from 0; in training the unlabelled questions follow the
            labelled ones.

    Raises IndexError where the split has no such question.
    """
    spec = source.spec
    for first, count in groups(spec, split).values():
        if first <= index < first + count:
            place = int(answer_positions(spec, split, first, count)[index - first])
            tally = Tally()
            if isinstance(source, Rooms):
                return next(render_rooms(source, split, [(index, place)], tally, device))
            questions = sample_questions(source, split, [(index, place, 0)], tally)
            done = _launch(source.spec, questions, device)()
            return _checked(source, split, done, tally, device)[0]
    raise IndexError(f"{split} has {getattr(spec, split)} questions, none with index {index}")


def groups(spec: QuestionSpec, split: str) -> dict[str, tuple[int, int]]:
    """Return for each HDF5 group of a split its first question and their number."""
    if split == "train":
        return {
            "labeled": (0, spec.labeled),
            "unlabeled": (spec.labeled, spec.train - spec.labeled),
        }
    return {"": (0, getattr(spec, split))}


def _launch(
    spec: SplitSpec, questions: Sequence[Question], device: str, kept: Collection[str] = ()
) -> Fetch:
    """Start to render questions; the function that is returned waits for their images."""
    names = ("image", "object_id", "depth") if spec.with_depth else ("image", "object_id")
    fetch = launch_fields(pack_questions(spec, questions), names, device, kept)
    image, depth_name = (KEPT + name if name in kept else name for name in ("image", "depth"))

    def rendered() -> list[Rendered]:
        pixels = fetch()
        shown = visible_pixels(pixels["object_id"], spec.cubes[1])
        result = []
        for i, question in enumerate(questions):
            its_images = slice((1 + spec.answers) * i, (1 + spec.answers) * (i + 1))
            depth = pixels[depth_name][its_images] if spec.with_depth else None
            result.append(Rendered(question, pixels[image][its_images], shown[its_images], depth))
        return result

    return rendered


def _checked(
    pools: Pools,
    split: str,
    done: list[Rendered],
    tally: Tally,
    device: str,
    kept: Collection[str] = (),
) -> list[Rendered]:
    """Make questions anew whose full images hide a cube after all."""
    spec = pools.spec
    while hidden := [i for i, question in enumerate(done) if not _shows_all(spec, question)]:
        again = [done[i].question for i in hidden]
        requests = [(q.index, q.shapes.answer, q.attempt + 1) for q in again]
        anew = sample_questions(pools, split, requests, tally)
        for i, question in zip(hidden, _launch(spec, anew, device, kept)(), strict=True):
            done[i] = question
    return done


def shows_every_cube(spec: SplitSpec, question: Question, device: str = "auto") -> bool:
    """Return whether each image of a question shows `min_cube_pixels` pixels of every cube."""
    ids = launch_fields(pack_questions(spec, [question]), ("object_id",), device)()["object_id"]
    shown = visible_pixels(ids, question.shapes.cubes.shape[1])
    return bool((shown >= spec.min_cube_pixels).all())


def _shows_all(spec: SplitSpec, rendered: Rendered) -> bool:
    used = rendered.question.shapes.cubes.shape[1]
    return bool((rendered.visible_pixels[:, :used] >= spec.min_cube_pixels).all())
