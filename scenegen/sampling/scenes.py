"""Propose scenes: `DatasetSpec`, indices and attempts -> `SceneArrays`. All randomness ends here.

Camera, lights, and the number, classes and materials of objects are drawn once for an item, so that
a refused proposal cannot bend their distributions. Another attempt draws only the sizes,
orientations and places of the objects again.
"""

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import PlacementError
from scenegen.common.random.seeding import Purpose, item_numbers
from scenegen.common.rotations import product, rotation_matrix
from scenegen.description.scene_arrays import SceneArrays
from scenegen.description.scenes import SceneSpec
from scenegen.description.specs import LEAST_SEEN, DatasetSpec, InteriorSpec, Request
from scenegen.objects.catalogue import Objects, objects_of
from scenegen.sampling.bodies import MARGIN, bodies_of
from scenegen.sampling.cameras import sample_cameras, sample_fov_y, with_right_eyes
from scenegen.sampling.interiors.scenes import item_room, sample_interiors
from scenegen.sampling.lights import sample_lights
from scenegen.sampling.objects import Unplaced, sample_counts, sample_objects
from scenegen.sampling.placement import (
    CANDIDATES,
    SEPARATORS,
    Frustums,
    find_places,
    make_frustums,
)
from scenegen.sampling.poses import random_rotations

Array = NDArray[Any]
# Before a request is called impossible, so many scenes are proposed for an item, and so many of
# these are rendered. In one of 20,000 rooms of built-in objects one proposal in forty finds room.
MAX_ATTEMPTS, MAX_RENDERED = 1000, 100
# Closed rooms take long. In the fullest of 10,000, one proposal in 34 found room.
MAX_FURNISHED = 300
POSES_PER_OBJECT = 8  # sizes and orientations tried for one object of a proposal
DOWN = np.array([[0.0, -1.0, 0.0]])
_TOGETHER = (0, 1, 3, POSES_PER_OBJECT)  # poses 0, 1 to 2, and 3 to 7 are tried at once
_POSE_NUMBERS = 6  # size, rotation, heading, and one to spare: positions in a stream are even
_NUMBERS = _POSE_NUMBERS + 2 * CANDIDATES  # of one pose


def sample_scenes(
    spec: Request, index: Any, attempt: Any, objects: Objects | None = None
) -> tuple[Array, SceneArrays]:
    """Propose scenes of items, many at once.

    Pure: a pair (index, attempt) gives the same scene on any machine, in any order, alone or among
    others. The caller renders a proposal, and asks for the next attempt if an object shows too few
    pixels.

    Args:
        index, attempt: integers, (N,), of which each pair is a proposal.
        objects: those of the spec by default.

    Returns:
        Whether each proposal found room for its objects, (N,) bool; and the scenes of those that
        did.

    Raises SpecError where no model of a class can be used.
    """
    index, attempt = np.asarray(index, np.int64), np.asarray(attempt, np.int64)
    if isinstance(spec, InteriorSpec):
        return sample_interiors(spec, index, attempt, objects or objects_of(spec))
    unplaced = sample_objects(spec, index, objects or objects_of(spec))
    cameras, fov_y_degrees = sample_cameras(spec, index), sample_fov_y(spec, index)
    frustums = make_frustums(spec, cameras, fov_y_degrees)
    placed, position, rotation, scale = _place_objects(spec, index, attempt, frustums, unplaced)
    light_count, light_position, light_color = sample_lights(spec, index)

    def same(values: Any, *shape: int) -> Array:
        return np.broadcast_to(np.array(values, float), (len(index), *shape))

    targets = same(spec.camera_target, cameras.shape[1], 3)
    cameras, targets = with_right_eyes(spec, cameras, targets)
    scenes = SceneArrays(
        names=unplaced.names,
        index=index,
        camera_position=cameras,
        camera_target=targets,
        fov_y_degrees=same(fov_y_degrees[:, None], cameras.shape[1]),
        object_count=unplaced.count,
        shape=unplaced.model,
        mesh=unplaced.mesh,
        position=position,
        rotation=rotation,
        scale=scale,
        reflectance=unplaced.reflectance,
        gloss=unplaced.gloss,
        light_count=light_count,
        light_position=light_position,
        light_color=light_color,
        ambient=same(spec.ambient, 3),
        attenuation=same(spec.attenuation, 2),
        room_reflectance=same(spec.room_reflectance, 3),
        background=same((0.0, 0.0, 0.0), 3),
        interior=np.full(len(index), "", object),
    )
    return placed, scenes.take(placed)


def sample_scene(
    spec: Request, index: int, attempt: int = 0, objects: Objects | None = None
) -> SceneSpec | None:
    """Propose the scene of one item, as `sample_scenes`; None where this attempt found no room."""
    _, scenes = sample_scenes(spec, [index], [attempt], objects)
    return scenes.scene(0) if len(scenes) else None


def most_attempts(spec: Request) -> int:
    """Return how many scenes are proposed for an item before a request is called impossible."""
    return MAX_FURNISHED if spec.interior else MAX_ATTEMPTS


def refusal(
    spec: Request,
    index: int,
    placed_but_hidden: int,
    attempts: int = MAX_ATTEMPTS,
    problems: Mapping[str, str] | None = None,
) -> PlacementError:
    """Return the error for item `index`, which got no scene.

    Args:
        placed_but_hidden: how many of its proposals found room and were rendered.
        attempts: how many were made.
        problems: reasons, by name, why models were refused.
    """
    off = "" if spec.principal_point == (0.5, 0.5) else ", or a more central --principal-point"
    if isinstance(spec, InteriorSpec):
        refused = [f"; {name} was passed over: {why}" for name, why in (problems or {}).items()]
        return PlacementError(
            f"item {index}",
            f"no room for its {item_room(spec, index)[1]} objects in {attempts} proposals"
            if not placed_but_hidden
            else f"{placed_but_hidden} proposals that show too few objects",
            f"room for all of them, and a camera that sees {LEAST_SEEN}",
            "try fewer --objects, more --classes, a wider --fov, fewer --min-visible-pixels, or"
            f" --views that are less far apart{off}{''.join(refused[:1])}",
        )
    objects = int(sample_counts(spec, np.array([index]))[0])
    if placed_but_hidden:
        return PlacementError(
            f"item {index}",
            f"{attempts} proposals with {objects} objects, {placed_but_hidden} of which were"
            " rendered, each with an object that shows too few pixels",
            f"{spec.min_visible_pixels} pixels or more of every object",
            "try fewer --objects, a larger --object-radius or fewer --min-visible-pixels" + off,
        )
    return PlacementError(
        f"item {index}",
        f"no room for its {objects} objects in {attempts} proposals",
        "room for all of them inside the walls and the image, touching nothing",
        "try fewer --objects, a smaller --object-radius or --allow-cropped" + off,
    )


def _place_objects(
    spec: DatasetSpec, index: Array, attempt: Array, frustums: Frustums, unplaced: Unplaced
) -> tuple[Array, Array, Array, Array]:
    """Place the objects of N items one after another; items without room for one get no more.

    Returns: whether all of an item's found room, (N,); and of the objects, zero in unused slots,
    positions (N, K, 3), rotations (N, K, 4) and scales (N, K).
    """
    slots = unplaced.model.shape[1]
    position, rotation = np.zeros((len(index), slots, 3)), np.zeros((len(index), slots, 4))
    scale = np.zeros((len(index), slots))
    placed = np.zeros((len(index), slots, len(SEPARATORS)))
    bodies = bodies_of(unplaced.outlines)
    going = np.ones(len(index), bool)
    for slot in range(slots):
        looking = np.flatnonzero(going & (unplaced.count > slot))
        for first, last in itertools.pairwise(_TOGETHER):
            if not len(looking):
                break
            tries = last - first
            rows = np.repeat(looking, tries)
            pose = slot * POSES_PER_OBJECT + np.tile(np.arange(first, last), len(looking))
            numbers = item_numbers(
                spec.seed, index[rows], Purpose.POSES, attempt[rows], _NUMBERS * pose,
                count=_NUMBERS,
            )  # fmt: skip
            kind = unplaced.outline[rows, slot]
            low, high = spec.object_radius
            size = low + (high - low) * numbers[:, 0]
            turn = random_rotations(bodies, kind, spec.pose, numbers[:, 1:5])
            matrix = rotation_matrix(turn.T)
            reach = size[:, None] * bodies.reach(kind, matrix, SEPARATORS, coarse=True) + MARGIN
            down = size * bodies.reach(kind, matrix, DOWN)[:, 0] + MARGIN
            border = size[:, None, None] * frustums.reach(bodies, kind, matrix, rows) + MARGIN
            border = 0.0 * border if spec.allow_cropped else border
            free, place = find_places(
                rows, reach, down, border, frustums, placed[:, :slot],
                numbers[:, _POSE_NUMBERS:].reshape(-1, CANDIDATES, 2),
            )  # fmt: skip
            free = free.reshape(-1, tries)
            best = np.arange(len(looking)) * tries + free.argmax(axis=1)
            done = free.any(axis=1)
            who, best, looking = looking[done], best[done], looking[~done]
            position[who, slot], rotation[who, slot] = place[best], turn[best]
            scale[who, slot] = size[best]
            placed[who, slot] = product(place[best], SEPARATORS.T) + reach[best]
        going[looking] = False
    return going, position, rotation, scale
