"""Find a question's shapes and views: every cube of each of its images shows."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.polycube import symmetries
from iqtt.questions import (
    Drawn,
    Pools,
    Shapes,
    arrange,
    draw_lights,
    draw_rotation,
    draw_shapes,
    question_key,
    rotation_angle_degrees,
)
from iqtt.specs import SplitSpec
from iqtt.views import Question, View, pack_views
from scenegen.errors import PlacementError
from scenegen.renderer import render
from scenegen.seeding import Purpose, item_rng
from scenegen.truth import visible_pixels

Array = NDArray[Any]
SHRINK = 4  # of the images that visibility is first judged by
MARGIN = 1.25  # pixels asked for in them, so that the full image seldom falls short
PROPOSED = 3  # views of one image judged at once, at least
PROPOSALS_AT_ONCE = 128  # views judged at once, about
VIEW_ATTEMPTS = 60  # views of one image, before the question gets other shapes
QUESTION_ATTEMPTS = 50  # shapes of one question
TURNS = 200  # rotations drawn until one is far enough from the reference's


@dataclass
class Tally:
    """How many views were proposed, and how many refused for hiding a cube."""

    proposed: int = 0
    refused: int = 0


@dataclass(eq=False)
class _Draft:
    index: int
    attempt: int
    shapes: Shapes
    symmetries: Array
    views: dict[int, View] = field(default_factory=dict)


def settle(
    spec: SplitSpec,
    pools: Pools,
    split: str,
    requests: Sequence[tuple[int, int, int]],
    tally: Tally,
    device: str = "auto",
) -> list[Question]:
    """Find shapes and views of questions; each depends on itself alone.

    Args:
        requests: (index, place of the right answer, attempt to begin with).

    Raises PlacementError where the bounded search finds none.
    """
    done: dict[int, Question] = {}
    waiting = list(requests)
    while waiting:
        drawn = draw_shapes(spec, pools, split, [(i, attempt) for i, _, attempt in waiting])
        drafts = _drafts(spec, split, waiting, drawn)
        _find_views(spec, split, drafts, (0,), tally, device)
        seen = [draft for draft in drafts if draft.views]
        _find_views(spec, split, seen, (1, 2, 3), tally, device)
        again = []
        for (index, place, attempt), draft in zip(waiting, drafts, strict=True):
            if len(draft.views) == 4:
                done[index] = _question(spec, split, draft)
            elif attempt + 1 < QUESTION_ATTEMPTS:
                again.append((index, place, attempt + 1))
            else:
                raise PlacementError(
                    f"{split} question {index}: no view of {QUESTION_ATTEMPTS} choices of shapes"
                    f" shows {spec.min_cube_pixels} pixels of every cube; try a smaller"
                    f" --min-cube-pixels, or fewer --cubes"
                )
        waiting = again
    return [done[index] for index, _, _ in requests]


def _drafts(
    spec: SplitSpec, split: str, requests: Sequence[tuple[int, int, int]], drawn: Sequence[Drawn]
) -> list[_Draft]:
    """Put the answers in order, and find the shapes' symmetries, all of one size at once."""
    drafts: list[_Draft] = []
    by_size: dict[int, list[int]] = {}
    for i, ((index, place, attempt), one) in enumerate(zip(requests, drawn, strict=True)):
        rng = item_rng(spec.seed or 0, question_key(split, index), Purpose.ANSWERS, attempt)
        drafts.append(_Draft(index, attempt, arrange(one, place, rng), np.empty(0)))
        by_size.setdefault(one[0].shape[1], []).append(i)
    for rows in by_size.values():
        found = symmetries(np.concatenate([drafts[i].shapes.cubes for i in rows]))
        for i, four in zip(rows, found.reshape(len(rows), 4, -1), strict=True):
            drafts[i].symmetries = four
    return drafts


def _find_views(
    spec: SplitSpec,
    split: str,
    drafts: Sequence[_Draft],
    slots: tuple[int, ...],
    tally: Tally,
    device: str,
) -> None:
    """Propose views of these images until a small rendering shows every cube of each."""
    small = spec.render_spec(SHRINK)
    scale = (small.height * small.width) / (spec.height * spec.width)
    enough = np.ceil(MARGIN * spec.min_cube_pixels * scale)
    tried = 0
    while tried < VIEW_ATTEMPTS:
        missing = [(d, s) for d in drafts for s in slots if s not in d.views]
        if not missing:
            return
        # The first view that will do is taken, so how many are judged at once changes nothing.
        number = min(VIEW_ATTEMPTS - tried, max(PROPOSED, PROPOSALS_AT_ONCE // len(missing)))
        proposals = [
            (draft, slot, _propose_view(spec, split, draft, slot, tried + k))
            for draft, slot in missing
            for k in range(number)
        ]
        tried += number
        batch = pack_views(spec, small, [view for _, _, view in proposals])
        shown = visible_pixels(render(batch, device).object_id, small.object_slots)
        for (draft, slot, view), pixels in zip(proposals, shown, strict=True):
            if slot in draft.views:
                continue
            tally.proposed += 1
            if (pixels[: len(view.cubes)] >= enough).all():
                draft.views[slot] = view
            else:
                tally.refused += 1


def _propose_view(spec: SplitSpec, split: str, draft: _Draft, slot: int, attempt: int) -> View:
    key = question_key(split, draft.index) * 4 + slot
    rng = item_rng(spec.seed or 0, key, Purpose.VIEW, draft.attempt * VIEW_ATTEMPTS + attempt)
    cubes = draft.shapes.cubes[slot]
    rotation = draw_rotation(rng)
    if slot:
        reference = draft.views[0].world_from_shape
        for _ in range(TURNS):
            angle = rotation_angle_degrees(reference, rotation, draft.symmetries[slot])
            if angle >= spec.min_angle_degrees:
                break
            rotation = draw_rotation(rng)
    dark = np.zeros((spec.lights[1], 3))  # visibility needs no light
    return View(cubes, rotation, dark, dark, 0)


def _lit(spec: SplitSpec, split: str, draft: _Draft, slot: int) -> View:
    """Return the view of an image with its lights, drawn apart from its rotation."""
    key = question_key(split, draft.index) * 4 + slot
    rng = item_rng(spec.seed or 0, key, Purpose.LIGHTS, draft.attempt)
    view = draft.views[slot]
    return View(view.cubes, view.world_from_shape, *draw_lights(spec, rng))


def _question(spec: SplitSpec, split: str, draft: _Draft) -> Question:
    views = tuple(_lit(spec, split, draft, slot) for slot in range(4))
    right = views[1 + draft.shapes.answer]
    angle = rotation_angle_degrees(
        views[0].world_from_shape, right.world_from_shape, draft.symmetries[0]
    )
    return Question(draft.index, draft.attempt, draft.shapes, views, angle)
