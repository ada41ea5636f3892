"""What a closed room has beside its objects: its size, openings and light, and who stands on whom.

Lengths are in metres, which are the scene units of such rooms. The floor is y = 0, and the room is
the box from the origin to `Interior.size`.
"""

from dataclasses import dataclass

from scenegen.common.names import check_choice
from scenegen.common.records import Vector3, check

WALLS = ("west", "east", "north", "south")  # x = 0, x = size[0], z = 0, z = size[2]
OPENINGS = ("window", "door")


@dataclass(frozen=True)
class Opening:
    """A rectangle in a wall: a window that is open to the sky, or a door that is shut.

    Attributes:
        kind: one of OPENINGS.
        wall: one of WALLS.
        left, right: along the wall, which is x or z, with left < right.
        bottom, top: heights.
    """

    kind: str
    wall: str
    left: float
    right: float
    bottom: float
    top: float

    def __post_init__(self) -> None:
        check_choice("opening", self.kind, OPENINGS)
        check_choice("wall", self.wall, WALLS)
        spans = (self.left, self.right), (self.bottom, self.top)
        ok = all(0 <= low < high for low, high in spans)
        check(ok, "opening", spans, "rising pairs of lengths from 0 on")


@dataclass(frozen=True)
class Interior:
    """A closed room.

    Attributes:
        size: of the inner box, along x, y and z.
        openings: windows and doors.
        stands_on: for each object, 0 for the room (its floor, walls, ceiling and sills), or the
            number of another object, from 1.
        hour: of the day, 0 to 24, which gives the height of the sun.
        facing_degrees: where the sun stands at noon: 0 towards -z, 90 towards +x.
        lit: whether lamps and the ceiling light are on.
    """

    size: Vector3
    openings: tuple[Opening, ...]
    stands_on: tuple[int, ...]
    hour: float
    facing_degrees: float
    lit: bool

    def __post_init__(self) -> None:
        check(len(self.size) == 3 and min(self.size) > 0, "room size", self.size, "three lengths")
        count = len(self.stands_on)
        ok = all(0 <= on <= count and on != k for k, on in enumerate(self.stands_on, start=1))
        check(ok, "stands on", self.stands_on, f"0, or another of the {count} objects")
        check(0 <= self.hour <= 24, "hour", self.hour, "from 0 to 24")


def wall_length(size: Vector3, wall: str) -> float:
    """Return how long a wall is, metres."""
    return size[2] if wall in ("west", "east") else size[0]
