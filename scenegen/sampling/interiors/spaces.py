"""What is taken in a room: boxes about objects, which may be turned about the vertical axis.

Two objects are apart if their boxes are: then an upright or a level plane passes between them, and
between their hulls. An object that stands inside another one, such as a book on a shelf, is apart
from it if its box meets the box of none of its triangles.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from scenegen.common.rotations import cos_sin
from scenegen.objects.furniture.shapes import Piece

GAP = 0.004  # metres between two objects side by side
ON = 2.0**-12  # metres between an object and what it stands on


@dataclass(frozen=True)
class Box:
    """A box that is turned about its vertical axis: world, metres.

    Attributes:
        x, z: its middle.
        half: half its sides, along its own x and z.
        bottom, top: heights.
        turns: about y, in full turns; its front looks along (sin, cos) in (x, z).
    """

    x: float
    z: float
    half: tuple[float, float]
    bottom: float
    top: float
    turns: float

    @property
    def axes(self) -> tuple[float, float]:
        """Cosine and sine of the turn."""
        return turn(self.turns)

    def point(self, x: float, z: float) -> tuple[float, float]:
        """Return a point of the box's own frame in the world, (x, z)."""
        c, s = self.axes
        return self.x + c * x + s * z, self.z - s * x + c * z

    def local(self, x: float, z: float) -> tuple[float, float]:
        """Return a point of the world, (x, z), in the box's own frame."""
        c, s = self.axes
        dx, dz = x - self.x, z - self.z
        return c * dx - s * dz, s * dx + c * dz

    def corners(self) -> list[tuple[float, float]]:
        """Return its corners seen from above."""
        (a, b) = self.half
        return [self.point(x, z) for x, z in ((a, b), (-a, b), (-a, -b), (a, -b))]

    def reach(self) -> tuple[float, float]:
        """Return how far it reaches from its middle along the world's x and z."""
        c, s = map(abs, self.axes)
        return c * self.half[0] + s * self.half[1], s * self.half[0] + c * self.half[1]


_TURNS: dict[float, tuple[float, float]] = {}


def turn(turns: float) -> tuple[float, float]:
    """Return cosine and sine of an angle in full turns."""
    known = _TURNS.get(turns)
    if known is None:
        cosine, sine = cos_sin(np.float64(turns))
        known = float(cosine), float(sine)
        if len(_TURNS) > 4096:
            _TURNS.clear()
        _TURNS[turns] = known
    return known


def box_at(piece: Piece, x: float, z: float, bottom: float, turns: float) -> Box:
    """Return the box of a piece of furniture in its place."""
    return Box(x, z, piece.half, bottom, bottom + piece.height, turns)


def apart(a: Box, b: Box, gap: float = GAP) -> bool:
    """Return whether a level or an upright plane keeps two boxes apart."""
    if a.bottom >= b.top or b.bottom >= a.top:
        return True
    dx, dz = b.x - a.x, b.z - a.z
    reach = a.half[0] + a.half[1] + b.half[0] + b.half[1] + gap
    if abs(dx) > reach or abs(dz) > reach:
        return True
    for one, other in ((a, b), (b, a)):
        c, s = one.axes
        oc, os_ = other.axes
        cosine, sine = abs(c * oc + s * os_), abs(c * os_ - s * oc)
        along, across = abs(c * dx - s * dz), abs(s * dx + c * dz)
        if along > one.half[0] + cosine * other.half[0] + sine * other.half[1] + gap:
            return True
        if across > one.half[1] + sine * other.half[0] + cosine * other.half[1] + gap:
            return True
    return False


def clear_of(parent: Piece, place: Box, child: Box) -> bool:
    """Return whether a child's box meets the boxes of none of the parent's triangles."""
    x, z = place.local(child.x, child.z)
    relative = Box(x, z, child.half, 0.0, 1.0, child.turns - place.turns).reach()
    low = np.array([x - relative[0], child.bottom - place.bottom, z - relative[1]])
    high = np.array([x + relative[0], child.top - place.bottom, z + relative[1]])
    hit = (parent.boxes[0] < high) & (parent.boxes[1] > low)
    return not bool(hit.all(axis=1).any())


@dataclass
class Placed:
    """A piece of furniture in its place; `stands_on` as in `description.interiors.Interior`."""

    piece: Piece
    box: Box
    stands_on: int


@dataclass
class Space:
    """A room while it is filled.

    Attributes:
        size: of the room.
        most: objects that it is to hold.
        placed: objects in their places, in the order of their numbers from 1.
        kept: boxes that further furniture on the floor keeps free, such as before a door.
        inner: objects that stand within another one's box, by the other's number.
    """

    size: tuple[float, float, float]
    most: int
    placed: list[Placed] = field(default_factory=list)
    kept: list[Box] = field(default_factory=list)

    @property
    def full(self) -> bool:
        """Whether it holds all objects that it should."""
        return len(self.placed) >= self.most

    def within(self, box: Box, margin: float = 0.02) -> bool:
        """Return whether a box is inside the walls, below the ceiling and above the floor."""
        reach = box.reach()
        return (
            reach[0] + margin <= box.x <= self.size[0] - reach[0] - margin
            and reach[1] + margin <= box.z <= self.size[2] - reach[1] - margin
            and box.top < self.size[1] - 0.02
            and box.bottom >= 0
        )

    def free(self, box: Box, parent: int = 0, gap: float = GAP, floor: bool = False) -> bool:
        """Return whether a box is apart from all objects, but its parent if it is clear of that.

        Args:
            parent: number of the object it stands on, 0 for none.
            floor: whether it must leave `kept` free.
        """
        if floor and not all(apart(box, other, 0.0) for other in self.kept):
            return False
        for number, other in enumerate(self.placed, start=1):
            if apart(box, other.box, gap):
                continue
            if number != parent or not clear_of(other.piece, other.box, box):
                return False
        return True

    def put(self, piece: Piece, box: Box, stands_on: int) -> int:
        """Place a piece; return its number."""
        self.placed.append(Placed(piece, box, stands_on))
        return len(self.placed)


def facing(turns_x: float, turns_z: float) -> float:
    """Return the turn, in full turns, whose front looks along (x, z)."""
    return stepped_turn(math.atan2(turns_x, turns_z) / (2 * math.pi))


def stepped_turn(turns: float) -> float:
    """Return the multiple of 1/256 of a turn next to one, so that it is alike everywhere."""
    return round(turns * 256) / 256
