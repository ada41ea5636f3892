"""Furnished rooms that differ in one thing, such as the place of a chair, seen by two cameras.

All rooms of an item follow the same rules and pass the same tests from both cameras. Which of them
a question shows from the first camera is chosen later, so nothing here depends on that choice.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

from scenegen.common.random.seeding import Purpose
from scenegen.description.specs import InteriorSpec
from scenegen.objects.catalogue import Objects
from scenegen.objects.furniture.shapes import Piece
from scenegen.sampling.interiors.arranging import Arranger, suits
from scenegen.sampling.interiors.draws import Draws
from scenegen.sampling.interiors.scenes import Drawn, furnished, item_room
from scenegen.sampling.interiors.small_things import ON_TOP
from scenegen.sampling.interiors.spaces import (
    ON,
    Box,
    Placed,
    Space,
    apart,
    box_at,
    clear_of,
    stepped_turn,
)
from scenegen.sampling.interiors.viewpoints import Place, draw_cameras

DIFFERENCES = ("moved", "swapped", "turned", "mirror-pair")
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
SWAPPED = ("stool", "box", "bag", "basket", "tall_plant", "armchair", "chair", "nightstand")
FRONTED = ("chair", "armchair", "nightstand", "screen")  # families whose front can be seen
TOPS = ("table", "coffee_table", "desk", "cabinet", "nightstand")  # families that carry things
HIGHEST_TOP = 1.1  # metres
SETS = 4  # sets of places that are drawn for a group
GROUPS = 6  # objects or groups of objects that are tried in a room
FREE = 60  # places on the floor, near a free one of which cameras look
REACH = 2.0  # metres about what cameras look at, within which places are tried
PIECES = 20  # groups of families that are tried for objects that change places
TRIES = 1000  # places that are tried for a group
APART, APART_ON_TOP = 0.5, 0.2  # metres between two places, on the floor and on a top
LEAST_TURN = 1 / 6  # full turns between two directions
LIKE = 1.5  # largest ratio of the sizes of objects that change places
NEAREST = 1.0  # metres from a camera to an object in play
INSIDE = 0.85  # share of half the image within which the middle of an object in play appears
LEAST_SIDE = 0.02  # square metres of a small object, seen from the side
LEAST_SHARE = 0.006  # of the image that an object in play covers, by its box
Support: TypeAlias = tuple[int, float, tuple[float, ...]]
"""Number of what carries things, 0 for the floor; height and sides of the surface in its frame."""
FLOOR: Support = (0, 0.0, ())


class Group(NamedTuple):
    """Objects in play: what they stand on, their numbers, and their pieces of furniture."""

    support: Support
    numbers: tuple[int, ...]
    pieces: tuple[Piece, ...]


Spot: TypeAlias = list[tuple[Box, int]]
"""For each object and direction that is to fit a place, its box and what it stands on."""


@dataclass(frozen=True)
class Alternatives:
    """Rooms that differ in one thing.

    Attributes:
        rooms: two or three, each with the positions of both cameras.
        in_play: numbers of the objects in which they differ; empty for mirror images.
    """

    rooms: tuple[Drawn, ...]
    in_play: tuple[int, ...]


def draw_alternatives(
    spec: InteriorSpec, index: int, difference: str, degrees: float, objects: Objects
) -> Iterator[Alternatives]:
    """Draw the rooms of an item, at most GROUPS times; nothing where it has no place for them.

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
    if difference == "mirror-pair":
        found = _cameras(spec, arranger.space, draws, fov, degrees)
        if found is not None:
            drawn: Drawn = (arranger.room, arranger.space.placed, *found)
            other = _mirrored(drawn)
            if _holds(other[1]):
                yield Alternatives(tuple(draws.shuffled((drawn, other))), ())
        return
    for group in itertools.islice(_groups(arranger, difference), GROUPS):
        yield from _varied(spec, arranger, difference, group, degrees, fov)


def _groups(arranger: Arranger, difference: str) -> Iterator[Group]:
    """Yield objects that can be in play together, in random order.

    Objects that change places are new ones, of about one size and three families. They take the
    numbers of objects that carry nothing, which are left out.
    """
    placed, draws = arranger.space.placed, arranger.draws
    supports = [_support(placed, thing) for thing in placed]
    if difference != "swapped":
        for number in draws.shuffled(range(1, len(placed) + 1)):
            piece, support = placed[number - 1].piece, supports[number - 1]
            if support and (difference != "turned" or piece.family in FRONTED):
                yield Group(support, (number,), (piece,))
        return
    carrying = {thing.stands_on for thing in placed}
    carrying |= {n for n, thing in enumerate(placed, start=1) if thing.piece.family == "curtain"}
    tops = draws.shuffled(sorted({s for s in supports if s} - {FLOOR}))
    for support in (FLOOR, *tops):
        leaves = [n for n in range(1, len(placed) + 1) if n not in carrying and n != support[0]]
        leaves = draws.shuffled(leaves)
        if support[0]:  # those there first
            leaves.sort(key=lambda n, on=support[0]: placed[n - 1].stands_on != on)  # type: ignore[misc]
        pieces = _alike(arranger, support) if len(leaves) >= 3 else ()
        if pieces:
            yield Group(support, tuple(leaves[:3]), pieces)


def _support(placed: Sequence[Placed], thing: Placed) -> Support | None:
    """Return the surface that a movable object stands on; None for what stays."""
    parent = placed[thing.stands_on - 1] if thing.stands_on else None
    if parent is None or parent.piece.family == "rug":
        return FLOOR if thing.piece.family in STANDING and thing.box.bottom < 0.1 else None
    if parent.piece.family not in TOPS or parent.piece.height > HIGHEST_TOP:
        return None
    if not _is_large(thing.piece):
        return None
    for y, *sides in parent.piece.surfaces:
        if abs(thing.box.bottom - parent.box.bottom - y - ON) < 1e-6:
            return (thing.stands_on, y, tuple(sides))
    return None


def _alike(arranger: Arranger, support: Support) -> tuple[Piece, ...]:
    """Draw three objects of about one size and different families; none where none are found."""
    below = arranger.space.placed[support[0] - 1].piece if support[0] else None
    families = SWAPPED if below is None else tuple(ON_TOP[below.family])
    for _ in range(PIECES):
        found = [arranger.member(x) for x in arranger.draws.shuffled(families)[:3]]
        pieces = tuple(piece for piece in found if piece is not None)
        sizes = [4 * piece.half[0] * piece.half[1] * piece.height for piece in pieces]
        alike = len(pieces) == 3 and max(sizes) <= LIKE**3 * min(sizes)
        if alike and (below is None or all(_is_large(p) and suits(p, below) for p in pieces)):
            return pieces
    return ()


def _is_large(piece: Piece) -> bool:
    return math.fsum(piece.half) * piece.height >= LEAST_SIDE


def _varied(
    spec: InteriorSpec,
    arranger: Arranger,
    difference: str,
    group: Group,
    degrees: float,
    fov: float,
) -> Iterator[Alternatives]:
    """Yield three rooms in which the objects of a group stand otherwise, seen by two cameras."""
    placed, draws = arranger.space.placed, arranger.draws
    support, numbers, pieces = group
    moving = _carried(placed, numbers)
    kept = [n for n in range(1, len(placed) + 1) if n not in moving]
    space = replace(arranger.space, placed=[placed[n - 1] for n in kept])
    empty = replace(arranger, space=space)
    parent = kept.index(support[0]) + 1 if support[0] else 0
    turns = [placed[n - 1].box.turns for n in numbers]
    if difference == "swapped":
        turns = [stepped_turn(draws.unit()) for _ in numbers]
    fitting = list(zip(pieces, turns, strict=True))
    if difference == "turned":
        fitting = [(pieces[0], turn) for turn in _directions(draws)]
    focuses = [placed[support[0] - 1].box] if parent else _free(empty, *fitting[0])
    cameras = _cameras(spec, space, draws, fov, degrees, focuses) if focuses else None
    if cameras is None:
        return
    fov_y = spec.fov_y(fov)
    views = _Views(*cameras, math.tan(math.radians(fov_y) / 2), spec.width / spec.height)
    surface = (parent, *support[1:])
    for _ in range(SETS):
        spots = _spots(empty, surface, fitting, 1 if difference == "turned" else 3, views)
        rooms = [
            _furnished(placed, group, kept, space, choice)
            for choice in ([spots[(i + j) % 3][i] for i in range(3)] if difference == "swapped"
                           else [spots[0][j] if difference == "turned" else spots[j][0]]
                           for j in range(3) if spots)
        ]  # fmt: skip
        things = [found for found in rooms if found is not None]
        if len(things) == 3:
            yield Alternatives(tuple((arranger.room, x, *cameras) for x in things), numbers)


def _cameras(
    spec: InteriorSpec,
    space: Space,
    draws: Draws,
    fov: float,
    degrees: float,
    focuses: Sequence[Box] = (),
) -> tuple[list[Place], Place] | None:
    """Draw the positions of both cameras, and the point that both look at; None for none."""
    found = draw_cameras(spec, space, draws, fov, (0.0, degrees), focuses)
    if found is None:
        return None
    places, targets = ([(x, y, z) for x, y, z in values.tolist()] for values in found)
    return places, targets[0]


def _furnished(
    placed: Sequence[Placed],
    group: Group,
    kept: Sequence[int],
    space: Space,
    choice: Sequence[tuple[Box, int]],
) -> list[Placed] | None:
    """Return the objects of a room, those of a group in these places; None where some collide.

    Args:
        kept: numbers of the objects in `space`, which does not move.
        choice: for each object of the group its box, and the number of what carries it in `space`.
    """
    things = list(placed)
    for number, piece, (box, on) in zip(group.numbers, group.pieces, choice, strict=True):
        things[number - 1] = Placed(piece, box, kept[on - 1] if on else 0)
        for n in sorted(_carried(placed, (number,)) - {number}):
            moved = _along(placed[n - 1].box, placed[number - 1].box, box)
            if not space.free(moved):
                return None
            things[n - 1] = replace(placed[n - 1], box=moved)
    return things


def _carried(placed: Sequence[Placed], numbers: Sequence[int]) -> set[int]:
    """Return objects and all that stands on them; a number is larger than that of what carries."""
    found = set(numbers)
    for number, thing in enumerate(placed, start=1):
        if thing.stands_on in found:
            found.add(number)
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
    pieces: Sequence[tuple[Piece, float]],
    count: int,
    views: _Views,
) -> list[Spot]:
    """Draw places at each of which all pieces fit, with their turns; none where there are too few.

    In any two of the places, two pieces can stand at the same time.
    """
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
        for piece, turns in pieces:
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
            pairs = [(a[0], b[0]) for other in spots for a in spot for b in other]
            if len(pieces) == 1 or all(apart(*pair) for pair in pairs):
                spots.append(spot)
        if len(spots) == count:
            return draws.shuffled(spots)
    return []


def _mirrored(drawn: Drawn) -> Drawn:
    """Return the mirror image of a room and its cameras; the objects in it are not mirrored."""
    room, things, places, target = drawn
    width = room.size[0]
    walls = {"west": "east", "east": "west"}
    openings = tuple(
        replace(hole, wall=walls[hole.wall])
        if hole.wall in walls
        else replace(hole, left=width - hole.right, right=width - hole.left)
        for hole in room.openings
    )
    # The sun is as high so many hours before noon as after.
    other = replace(
        room,
        openings=openings,
        hour=24 - room.hour,
        facing_degrees=-room.facing_degrees % 360,
        mirrored=True,
    )
    boxes = [replace(t.box, x=width - t.box.x, turns=-t.box.turns) for t in things]
    moved = [replace(t, box=box) for t, box in zip(things, boxes, strict=True)]
    seen_from = [(width - x, y, z) for x, y, z in places]
    return other, moved, seen_from, (width - target[0], *target[1:])


def _holds(things: Sequence[Placed]) -> bool:
    """Return whether all objects are apart, and stand on surfaces of what carries them.

    The mirror image of a room need not, as objects may have one hand, such as a desk's drawers.
    """
    for number, thing in enumerate(things, start=1):
        for other in things[: number - 1]:
            below = thing.stands_on and other is things[thing.stands_on - 1]
            if apart(thing.box, other.box):
                continue
            if not below or not clear_of(other.piece, other.box, thing.box):
                return False
        parent = things[thing.stands_on - 1] if thing.stands_on else None
        if parent is not None and parent.piece.family != "rug":
            height = thing.box.bottom - parent.box.bottom - ON
            if not any(
                abs(y - height) < 1e-6 and Arranger.stands(thing.box, parent.box, sides)
                for y, *sides in parent.piece.surfaces
            ):
                return False
    return True
