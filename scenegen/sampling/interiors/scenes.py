"""Propose closed rooms: `InteriorSpec`, indices and attempts -> `SceneArrays`.

The room, its light, the number of objects and the field of view are drawn once for an item.
Another attempt draws the furniture and the cameras again.
"""

import zlib
from collections.abc import Sequence
from contextlib import suppress
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.random.seeding import Purpose, item_numbers
from scenegen.common.records import to_json
from scenegen.description.interiors import Interior
from scenegen.description.scene_arrays import SceneArrays
from scenegen.description.specs import InteriorSpec
from scenegen.objects.catalogue import Objects, furniture_models
from scenegen.objects.furniture.shapes import Piece, piece
from scenegen.objects.meshes.as_furniture import OBJECT
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.sampling.interiors.arranging import Arranger
from scenegen.sampling.interiors.draws import Draws
from scenegen.sampling.interiors.recipes import furnish
from scenegen.sampling.interiors.rooms import Room, draw_room
from scenegen.sampling.interiors.spaces import Placed, Space, turn
from scenegen.sampling.interiors.viewpoints import draw_cameras

Array = NDArray[Any]
STREET = 32  # rooms beside each other that are furnished from the same stock
STOCK = 10  # models of each family in it: models take longer to make than rooms to furnish
Drawn = tuple[Room, list[Placed], Any, Any]  # camera positions and targets, (V, 3)


def item_room(spec: InteriorSpec, index: int) -> tuple[Room, int, float]:
    """Return the room of an item, its number of objects, and its field of view in degrees."""
    draws = Draws(spec.seed, index, Purpose.ROOM)
    count = draws.count(*spec.objects)
    room = draw_room(draws, spec.hours, count)
    return room, count, spec.fov_degrees + spec.fov_spread_degrees * draws.unit()


def draw_interior(spec: InteriorSpec, index: int, attempt: int, objects: Objects) -> Drawn | None:
    """Return room, objects, camera positions and targets; None if the proposal found no room."""
    arranger = furnished(spec, index, attempt, objects)
    if arranger is None:
        return None
    room, space, fov = arranger.room, arranger.space, item_room(spec, index)[2]
    found = draw_cameras(spec, space, Draws(spec.seed, index, Purpose.VIEWPOINT, attempt), fov)
    return None if found is None else (room, space.placed, *found)


def furnished(spec: InteriorSpec, index: int, attempt: int, objects: Objects) -> Arranger | None:
    """Return an item's room with its furniture; None if this attempt found no place for all."""
    room, count, _ = item_room(spec, index)
    draws = Draws(spec.seed, index, Purpose.ARRANGEMENT, attempt)
    by_family = furniture_models(objects)

    def member(family: str) -> Piece | None:
        models = by_family.get(family)
        if not models:
            return None
        share = draws.pick(_stock(spec.seed, index // STREET, family))
        with suppress(BadMeshError):  # a mesh that cannot be used is left out
            return piece(objects.shape, models[int(share * len(models))])
        return None

    space = Space(room.size, count)
    arranger = Arranger(room, space, draws, member, OBJECT if OBJECT in by_family else "")
    if count:
        furnish(arranger)
    return None if len(space.placed) < count else arranger


@lru_cache(maxsize=256)
def _stock(seed: int, street: int, family: str) -> tuple[float, ...]:
    """Return where among a family's models, 0 to 1, those are that furnish a street's rooms."""
    stream = zlib.crc32(family.encode()) % 2**24
    return tuple(item_numbers(seed, street, Purpose.MODELS, stream, count=STOCK).tolist())


def sample_interiors(
    spec: InteriorSpec, index: Array, attempt: Array, objects: Objects
) -> tuple[Array, SceneArrays]:
    """Propose closed rooms, as `sampling.scenes.sample_scenes`."""
    pairs = list(zip(index.tolist(), attempt.tolist(), strict=True))
    drawn = [draw_interior(spec, i, tried, objects) for i, tried in pairs]
    placed = np.array([found is not None for found in drawn], bool)
    found = [scene for scene in drawn if scene is not None]
    return placed, scene_arrays(spec, index[placed], found, objects)


@lru_cache(maxsize=16)
def _numbers(objects: Objects, classes: tuple[str, ...]) -> dict[str, int]:
    """Return the numbers of models by name."""
    names = (model for name in classes for model in objects.models[name])
    return {name: i for i, name in enumerate(names)}


def scene_arrays(
    spec: InteriorSpec, index: Array, drawn: Sequence[Drawn], objects: Objects
) -> SceneArrays:
    """Return drawn rooms, with as many cameras as the spec has views, as arrays."""
    count, slots, views = len(drawn), spec.object_slots, len(spec.view_angles)
    number = _numbers(objects, spec.shapes)
    shape, mesh = np.full((count, slots), -1, np.int32), np.full((count, slots), "", object)
    position, scale = np.zeros((count, slots, 3)), np.zeros((count, slots))
    rotation = np.zeros((count, slots, 4))
    camera, target = np.zeros((count, views, 3)), np.zeros((count, views, 3))
    fov, interior = np.zeros((count, views)), np.full(count, "", object)
    for row, (room, things, places, at) in enumerate(drawn):
        for k, thing in enumerate(things):
            name = thing.piece.name
            shape[row, k], mesh[row, k] = number[name], objects.digest(name)
            box = thing.box
            position[row, k] = box.x, (box.bottom + box.top) / 2, box.z
            scale[row, k] = thing.piece.radius
            cosine, sine = turn(box.turns / 2)
            rotation[row, k] = cosine, 0.0, sine, 0.0
        camera[row], target[row] = places, at
        degrees = item_room(spec, int(index[row]))[2]
        fov[row] = spec.fov_y(degrees)
        told = Interior(
            room.size, room.openings, tuple(thing.stands_on for thing in things),
            room.hour, room.facing_degrees, room.lit,
        )  # fmt: skip
        interior[row] = to_json(told)
    used = shape >= 0

    def same(values: Any, *size: int) -> Array:
        return np.broadcast_to(np.array(values, float), (count, *size))

    rho = np.broadcast_to(np.array((0.8,) * 3), (count, slots, 3))
    gloss = np.broadcast_to(np.array((0.0, 1.0)), (count, slots, 2))
    return SceneArrays(
        names=tuple(number),
        index=index,
        camera_position=camera,
        camera_target=target,
        fov_y_degrees=fov,
        object_count=used.sum(axis=1).astype(np.int32),
        shape=shape,
        mesh=mesh,
        position=position,
        rotation=rotation,
        scale=scale,
        reflectance=np.where(used[..., None], rho, 0.0),
        gloss=gloss,
        light_count=np.zeros(count, np.int32),
        light_position=np.zeros((count, spec.light_slots, 3)),
        light_color=np.zeros((count, spec.light_slots, 3)),
        ambient=same((0.0, 0.0, 0.0), 3),
        attenuation=same((0.5, 0.5), 2),
        room_reflectance=same((0.8,) * 3, 3),
        background=same((0.0, 0.0, 0.0), 3),
        interior=interior,
    )
