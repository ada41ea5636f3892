"""Furnished rooms that differ in one thing, such as the place of a chair, seen by two cameras.

All rooms of an item follow the same rules and pass the same tests from both cameras. Which of them
a question shows from the first camera is chosen later, so nothing here depends on that choice.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from scenegen.common.random.seeding import Purpose
from scenegen.description.specs import InteriorSpec
from scenegen.objects.catalogue import Objects
from scenegen.objects.furniture.shapes import Piece
from scenegen.sampling.interiors.arranging import Arranger
from scenegen.sampling.interiors.draws import Draws
from scenegen.sampling.interiors.scenes import Drawn, furnished, item_room
from scenegen.sampling.interiors.spaces import (
    ON,
    Box,
    Placed,
    Space,
    box_at,
    stepped_turn,
)
from scenegen.sampling.interiors.viewpoints import Place, draw_cameras

DIFFERENCES = ("moved", "turned")
STANDING = (
    "chair",
    "armchair",
    "stool",
    "floor_lamp",
    "tall_plant",
    "box",
    "bag",
    "basket",
    "coffee_table",
    "nightstand",
)  # families that may stand anywhere on the floor
FRONTED = ("chair", "armchair", "nightstand", "screen")  # families whose front can be seen
TOPS = ("table", "coffee_table", "desk", "cabinet", "nightstand")  # families that carry things
HIGHEST_TOP = 1.1  # metres
SETS = 4  # sets of places that are drawn for an object
OBJECTS = 6  # that are tried in a room
FREE = 60  # places on the floor, near a free one of which cameras look
REACH = 2.0  # metres about what cameras look at, within which places are tried
TRIES = 1000  # places that are tried for an object
APART, APART_ON_TOP = 0.5, 0.2  # metres between two places, on the floor and on a top
LEAST_TURN = 1 / 6  # full turns between two directions
NEAREST = 1.0  # metres from a camera to an object in play
INSIDE = 0.85  # share of half the image within which the middle of an object in play appears
LEAST_SIDE = 0.02  # square metres of a small object, seen from the side
LEAST_SHARE = 0.006  # of the image that an object in play covers, by its box
Support: TypeAlias = tuple[int, float, tuple[float, ...]]
"""Number of what carries things, 0 for the floor; height and sides of the surface in its frame."""
FLOOR: Support = (0, 0.0, ())


Spot: TypeAlias = list[tuple[Box, int]]
"""For each direction of an object, its box at a place and what it stands on."""


@dataclass(frozen=True)
class Alternatives:
    """Rooms that differ in one thing.

    Attributes:
        rooms: three, each with the positions of both cameras.
        in_play: number of the object in which they differ.
    """

    rooms: tuple[Drawn, ...]
    in_play: int


def draw_alternatives(
    spec: InteriorSpec, index: int, difference: str, degrees: float, objects: Objects
) -> Iterator[Alternatives]:
    """Draw the rooms of an item, at most OBJECTS * SETS times; nothing where no place is free.

    Args:
        difference: one of DIFFERENCES.
        degrees: from the first camera to the second, about the vertical axis through the point
            that both look at.
    """
    arranger = furnished(spec, index, 0, objects)
    if arranger is None:
        return
    draws = Draws(spec.seed, index, Purpose.PERSPECTIVE)
    arranger = replace(arranger, draws=draws)
    fov = item_room(spec, index)[2]
    for number, support in itertools.islice(_movable(arranger, difference), OBJECTS):
        yield from _varied(spec, arranger, difference, number, support, degrees, fov)


def _movable(arranger: Arranger, difference: str) -> Iterator[tuple[int, Support]]:
    """Yield the numbers of objects that can be in play, and what they stand on, in random order."""
    placed = arranger.space.placed
    for number in arranger.draws.shuffled(range(1, len(placed) + 1)):
        thing = placed[number - 1]
        support = _support(placed, thing)
        if support and (difference != "turned" or thing.piece.family in FRONTED):
            yield number, support


def _support(placed: Sequence[Placed], thing: Placed) -> Support | None:
    """Return the surface that a movable object stands on; None for what stays."""
    parent = placed[thing.stands_on - 1] if thing.stands_on else None
    if parent is None or parent.piece.family == "rug":
        return FLOOR if thing.piece.family in STANDING and thing.box.bottom < 0.1 else None
    if parent.piece.family not in TOPS or parent.piece.height > HIGHEST_TOP:
        return None
    if math.fsum(thing.piece.half) * thing.piece.height < LEAST_SIDE:
        return None
    for y, *sides in parent.piece.surfaces:
        if abs(thing.box.bottom - parent.box.bottom - y - ON) < 1e-6:
            return (thing.stands_on, y, tuple(sides))
    return None


def _varied(
    spec: InteriorSpec,
    arranger: Arranger,
    difference: str,
    number: int,
    support: Support,
    degrees: float,
    fov: float,
) -> Iterator[Alternatives]:
    """Yield three rooms in which an object stands otherwise, seen by two cameras."""
    placed, draws, turned = arranger.space.placed, arranger.draws, difference == "turned"
    piece, box = placed[number - 1].piece, placed[number - 1].box
    moving = _carried(placed, number)
    kept = [n for n in range(1, len(placed) + 1) if n not in moving]
    space = replace(arranger.space, placed=[placed[n - 1] for n in kept])
    empty = replace(arranger, space=space)
    parent = kept.index(support[0]) + 1 if support[0] else 0
    turns = _directions(draws) if turned else [box.turns]
    focuses = [placed[support[0] - 1].box] if parent else _free(empty, piece, turns[0])
    cameras = _cameras(spec, space, draws, fov, degrees, focuses) if focuses else None
    if cameras is None:
        return
    fov_y = spec.fov_y(fov)
    views = _Views(*cameras, math.tan(math.radians(fov_y) / 2), spec.width / spec.height)
    surface = (parent, *support[1:])
    for _ in range(SETS):
        spots = _spots(empty, surface, piece, turns, 1 if turned else 3, views)
        rooms = [
            _furnished(placed, number, kept, space, *choice)
            for choice in (spots[0] if turned and spots else [spot[0] for spot in spots])
        ]
        things = [found for found in rooms if found is not None]
        if len(things) == 3:
            yield Alternatives(tuple((arranger.room, x, *cameras) for x in things), number)


def _cameras(
    spec: InteriorSpec,
    space: Space,
    draws: Draws,
    fov: float,
    degrees: float,
    focuses: Sequence[Box],
) -> tuple[list[Place], Place] | None:
    """Draw the positions of both cameras, and the point that both look at; None for none."""
    found = draw_cameras(spec, space, draws, fov, (0.0, degrees), focuses)
    if found is None:
        return None
    places, targets = ([(x, y, z) for x, y, z in values.tolist()] for values in found)
    return places, targets[0]


def _furnished(
    placed: Sequence[Placed], number: int, kept: Sequence[int], space: Space, box: Box, on: int
) -> list[Placed] | None:
    """Return the objects of a room, one of them in this place; None where some collide.

    Args:
        kept: numbers of the objects in `space`, which does not move.
        on: number of what carries the object in `space`.
    """
    things = list(placed)
    things[number - 1] = replace(placed[number - 1], box=box, stands_on=kept[on - 1] if on else 0)
    for n in sorted(_carried(placed, number) - {number}):
        moved = _along(placed[n - 1].box, placed[number - 1].box, box)
        if not space.free(moved):
            return None
        things[n - 1] = replace(placed[n - 1], box=moved)
    return things


def _carried(placed: Sequence[Placed], number: int) -> set[int]:
    """Return an object and all that stands on it; a number is larger than that of what carries."""
    found = {number}
    for n, thing in enumerate(placed, start=1):
        if thing.stands_on in found:
            found.add(n)
    return found


def _along(box: Box, old: Box, new: Box) -> Box:
    """Return the place of a box that moves with another one from an old place to a new one."""
    x, z = new.point(*old.local(box.x, box.z))
    rise, turned = new.bottom - old.bottom, new.turns - old.turns
    bottom, top = box.bottom + rise, box.top + rise
    return replace(box, x=x, z=z, bottom=bottom, top=top, turns=box.turns + turned)


def _free(arranger: Arranger, piece: Piece, turns: float) -> list[Box]:
    """Return some places on the floor where a piece can stand."""
    width, _, depth = arranger.space.size
    at = ((arranger.draws.span(0, width), arranger.draws.span(0, depth)) for _ in range(FREE))
    boxes = [box_at(piece, x, z, 0.0, turns) for x, z in at]
    return [box for box in boxes if arranger.space.within(box) and arranger.standing(piece, box)]


def _directions(draws: Draws) -> list[float]:
    """Draw three directions that are LEAST_TURN apart, in full turns."""
    while True:
        turns = [stepped_turn(draws.unit()) for _ in range(3)]
        apart = (abs(a - b) for a, b in itertools.combinations(turns, 2))
        if all(LEAST_TURN <= d <= 1 - LEAST_TURN for d in apart):
            return turns


@dataclass(frozen=True)
class _Views:
    """Two level cameras that look at one point, and whether both see a box, if nothing hides it.

    Attributes:
        places: of the cameras.
        target: what they look at.
        half: tangent of half the vertical field of view.
        aspect: width of an image, in heights.
    """

    places: Sequence[Place]
    target: Place
    half: float
    aspect: float

    def show(self, box: Box) -> bool:
        """Return whether a box is in both images, and large enough there, but not too near."""
        width, height = math.fsum(box.half), box.top - box.bottom
        for place in self.places:
            ahead = self.target[0] - place[0], self.target[2] - place[2]
            away = math.hypot(*ahead)
            dx, dz = box.x - place[0], box.z - place[2]
            along = (dx * ahead[0] + dz * ahead[1]) / away
            across = abs(dx * ahead[1] - dz * ahead[0]) / away
            edge = along * self.half
            if along < NEAREST or across > INSIDE * edge * self.aspect:
                return False
            rise = (box.top + box.bottom) / 2 - place[1]
            tilt = along * (self.target[1] - place[1]) / away
            if abs(rise - tilt) > INSIDE * edge:
                return False
            area = width * (height + width * abs(rise) / along)
            if area < LEAST_SHARE * 4 * edge * edge * self.aspect:
                return False
        return True


def _spots(
    arranger: Arranger,
    support: Support,
    piece: Piece,
    directions: Sequence[float],
    count: int,
    views: _Views,
) -> list[Spot]:
    """Draw places at each of which a piece fits in all directions; none where there are too few."""
    space, draws = arranger.space, arranger.draws
    parent, y, sides = support
    spots: list[Spot] = []
    for _ in range(TRIES):
        if parent:
            below = space.placed[parent - 1].box
            at = below.point(draws.span(*sides[:2]), draws.span(*sides[2:]))
        else:
            at = tuple(views.target[k] + draws.span(-REACH, REACH) for k in (0, 2))  # type: ignore[assignment]
        least = APART_ON_TOP if parent else APART
        if any(math.dist(at, (spot[0][0].x, spot[0][0].z)) < least for spot in spots):
            continue
        spot: Spot = []
        for turns in directions:
            box = box_at(piece, *at, below.bottom + y + ON if parent else 0.0, turns)
            if not views.show(box):
                break
            if parent:
                stands = arranger.stands(box, below, sides) and space.free(box, parent)
                found = (box, parent) if stands else None
            else:
                found = arranger.standing(piece, box) if space.within(box) else None
            if found is None:
                break
            spot.append(found)
        else:
            spots.append(spot)
        if len(spots) == count:
            return draws.shuffled(spots)
    return []
