"""Draw questions about furnished rooms, and render their images.

Options are drawn, accepted and rendered before anything depends on which of them is right: the
reference is then another view of that one's room.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.perspective.specs import PerspectiveSpec
from iqtt.questions.distractors import question_key
from iqtt.questions.kinds import DISTRACTOR_KINDS
from iqtt.questions.views import Tally
from scenegen.common.errors import PlacementError
from scenegen.common.random.seeding import Purpose
from scenegen.common.records import check
from scenegen.description.scene_arrays import SceneArrays
from scenegen.description.specs import InteriorSpec
from scenegen.objects.catalogue import Objects, objects_of
from scenegen.rendering.amodal import whole_pixels
from scenegen.rendering.ground_truth import encode_image, visible_pixels
from scenegen.rendering.packing import pack_arrays
from scenegen.rendering.pictures.development import redeveloped
from scenegen.rendering.renderer import launch_fields, trace
from scenegen.sampling.interiors.alternatives import draw_alternatives
from scenegen.sampling.interiors.draws import Draws
from scenegen.sampling.interiors.scenes import scene_arrays

Array = NDArray[Any]
ATTEMPTS = 1024  # rooms that are drawn for a question
ANCHORS = 2  # other objects, at least, that all images show
LEAST_SHOWN = 0.005  # share of an image's pixels that show an object in play
LEAST_SHARE = 0.5  # of the pixels of an object in play, if nothing hid it, those that show it
LEAST_CHANGED = 0.005  # share of pixels in which two options show other objects
REFERENCE, OPTION = 0, 1  # cameras


@dataclass(frozen=True, eq=False)
class Rooms:
    """The settings of questions, and what their rooms are furnished with."""

    spec: PerspectiveSpec
    interior: InteriorSpec
    objects: Objects


@dataclass(frozen=True, eq=False)
class Drawn:
    """The options of a question, of which none is chosen yet, and the references that each has.

    Attributes:
        index: number of the question in its split.
        kind: of the wrong options, index into DISTRACTOR_KINDS.
        angle_degrees: between the lines of sight of reference and options.
        scenes: of each camera, K rooms with one view each.
        in_play: number of the object in which options differ.
        ids, depth: of each camera and room, (2, K, H, W).
        visible, whole: pixels that show this object, and would if nothing hid it, (2, K).
    """

    index: int
    kind: int
    angle_degrees: float
    scenes: tuple[SceneArrays, SceneArrays]
    in_play: int
    ids: Array
    depth: Array
    visible: Array
    whole: Array


def make_rooms(spec: PerspectiveSpec) -> Rooms:
    """Return what questions are drawn from. Raises SpecError for a spec without a seed."""
    check(spec.seed is not None, "seed", "none, as in files that do not tell it", "a number")
    interior = spec.interior()
    return Rooms(spec, interior, objects_of(interior))


def draw_question(
    rooms: Rooms, split: str, index: int, tally: Tally, device: str = "auto"
) -> Drawn:
    """Draw rooms until three places and all views meet the rules; pure but for the tally.

    Raises PlacementError where none of ATTEMPTS rooms does.
    """
    spec, key = rooms.spec, question_key(split, index)
    draws = Draws(rooms.interior.seed, key, Purpose.QUESTION)
    kind = draws.pick(spec.kinds)
    angle = draws.span(*spec.angle)
    degrees = -angle if draws.chance(0.5) else angle
    for attempt in range(ATTEMPTS):
        number = (
            (key >> 3) * ATTEMPTS + attempt
        ) << 3 | key & 7  # neighbours share their furniture
        tally.proposed += 1
        for found in draw_alternatives(rooms.interior, number, kind, degrees, rooms.objects):
            scenes = _scenes(rooms, number, found.rooms)
            drawn = _seen(rooms, index, kind, angle, scenes, found.in_play, device)
            if drawn is not None:
                return drawn
        tally.refused += 1
    raise PlacementError(
        f"{split} question {index}",
        f"none of {ATTEMPTS} rooms has places for a question of type {kind!r}",
        hint="try more --objects, a smaller --angle, or other --distractors",
    )


def _scenes(rooms: Rooms, number: int, drawn: Sequence[Any]) -> tuple[SceneArrays, SceneArrays]:
    index = np.full(len(drawn), number)
    both = []
    for camera in (REFERENCE, OPTION):
        seen = [(room, things, [places[camera]], at) for room, things, places, at in drawn]
        both.append(scene_arrays(rooms.interior, index, seen, rooms.objects))
    return both[0], both[1]


def _seen(
    rooms: Rooms,
    index: int,
    kind: str,
    angle: float,
    scenes: tuple[SceneArrays, SceneArrays],
    in_play: int,
    device: str,
) -> Drawn | None:
    """Return a question if both cameras see all its rooms well, else None."""
    spec, count = rooms.spec, len(scenes[0])
    batches = [pack_arrays(rooms.interior, s, (view,), rooms.objects)
               for view, s in enumerate(scenes)]  # fmt: skip
    pixels = [launch_fields(batch, ("object_id", "depth"), device)() for batch in batches]
    ids = np.stack([found["object_id"] for found in pixels])
    for i in range(count):
        if any((ids[OPTION, i] != ids[OPTION, j]).mean() < LEAST_CHANGED for j in range(i)):
            return None
    least = LEAST_SHOWN * spec.height * spec.width
    flat = ids.reshape(-1, *ids.shape[2:])
    shown = visible_pixels(flat, rooms.interior.object_slots).reshape(2, count, -1)
    large, visible = np.all(shown >= least, axis=(0, 1)), shown[..., in_play - 1]
    if not large[in_play - 1] or np.count_nonzero(large) < 1 + ANCHORS:
        return None
    every = np.arange(count)
    slot = np.full(count, in_play - 1)
    whole = np.stack([whole_pixels(batch, every, slot, device) for batch in batches])
    if (visible < LEAST_SHARE * whole).any():
        return None
    depth = np.stack([found["depth"] for found in pixels])
    code = DISTRACTOR_KINDS.index(kind)
    return Drawn(index, code, angle, scenes, in_play, ids, depth, visible, whole)


@dataclass(frozen=True, eq=False)
class RenderedRooms:
    """A question with its images; attributes as columns of the file.

    Attributes:
        answer: which option shows the reference's room.
        scenes: that of each image as JSON.
        images: reference and K options, (1 + K, H, W, 3).
        exposure: how these were developed, (1 + K, 5), as `pictures.development.EXPOSURE`.
        seed: of surfaces and of the noise of images.
    """

    drawn: Drawn
    answer: int
    scenes: list[str]
    images: Array
    exposure: Array
    seed: int

    def of_images(self, values: Array) -> Array:
        """Return what images show, from values of each camera and room, (2, K, ...)."""
        return np.concatenate([values[REFERENCE, self.answer, None], values[OPTION]])


def render_rooms(
    rooms: Rooms,
    split: str,
    places: Sequence[tuple[int, int]],
    tally: Tally,
    device: str = "auto",
) -> Iterator[RenderedRooms]:
    """Yield questions one at a time; `places` has the index and the right option of each.

    Raises as `draw_question`, and BackendError as `renderer.trace`.
    """
    for index, answer in places:
        drawn = draw_question(rooms, split, index, tally, device)
        yield _rendered(rooms, drawn, answer, device)


def _rendered(rooms: Rooms, drawn: Drawn, answer: int, device: str) -> RenderedRooms:
    """Trace the images of a question: rooms apart, as images of one item share their surfaces."""
    spec = rooms.spec
    # Surfaces and noise have a seed of their own, which files can tell.
    seed = picture_seed(rooms.interior.seed, int(drawn.scenes[REFERENCE].index[0]))
    radiance = replace(rooms.interior, image_dtype="float32", seed=seed)
    options = len(drawn.scenes[OPTION])
    found: dict[tuple[int, int], dict[str, Array]] = {}
    for k in range(options):
        views = (REFERENCE, OPTION) if k == answer else (OPTION,)
        batches = [pack_arrays(radiance, drawn.scenes[v].take([k]), (v,), rooms.objects)
                   for v in views]  # fmt: skip
        traced = [trace(batch, ("image", "exposure"), device) for batch in batches]
        found |= {(v, k): one for v, one in zip(views, traced, strict=True)}
    shown = [found[REFERENCE, answer], *(found[OPTION, k] for k in range(options))]
    exposure = np.concatenate([one["exposure"] for one in shown])
    # The options have one exposure, which depends on all of them alike.
    exposure[1:] = np.exp(np.log(exposure[1:]).mean(axis=0))
    images = np.concatenate([one["image"] for one in shown])
    if spec.image_dtype == "uint8":
        images = np.stack([redeveloped(*pair) for pair in zip(images, exposure, strict=True)])
    images = encode_image(images, spec.image_dtype)
    scenes = [drawn.scenes[REFERENCE].to_json(answer)]
    scenes += [drawn.scenes[OPTION].to_json(k) for k in range(options)]
    return RenderedRooms(drawn, answer, scenes, images, exposure, seed)


def picture_seed(seed: int, number: int) -> int:
    """Return the seed of a room's surfaces, which does not tell that of the split."""
    text = f"surfaces {seed} {number}"
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8]) >> 1


def room_rows(rendered: Sequence[RenderedRooms]) -> dict[str, Any]:
    """Return the values of each question by column, as `columns.room_columns` has them."""
    kinds = np.array([[one.drawn.kind] * len(one.drawn.scenes[0]) for one in rendered], np.int8)
    answers = np.array([one.answer for one in rendered], np.uint8)
    kinds[np.arange(len(kinds)), answers] = -1
    return {
        "questions": [one.images for one in rendered],
        "answers": answers,
        "scene": np.array([one.scenes for one in rendered], object),
        "distractor_kind": kinds,
        "angle_degrees": np.array([one.drawn.angle_degrees for one in rendered]),
        "in_play": np.array([one.drawn.in_play for one in rendered], np.int8),
        "visible_pixels": np.array([one.of_images(one.drawn.visible) for one in rendered]),
        "whole_pixels": np.array([one.of_images(one.drawn.whole) for one in rendered]),
        "exposure": np.array([one.exposure for one in rendered]),
        "picture_seed": np.array([one.seed for one in rendered], np.int64),
        "depth": [one.of_images(one.drawn.depth) for one in rendered],
    }
