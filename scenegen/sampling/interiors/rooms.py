"""Rooms without furniture: their size, windows and door, and their light."""

from dataclasses import dataclass

from scenegen.description.interiors import WALLS, Opening, wall_length
from scenegen.sampling.interiors.draws import Draws

STEP = 2.0**-8  # metres, of which all lengths of a room are multiples
CORNER = 0.4  # least distance of an opening from a corner
FULL = 36  # objects, with fewer of which a room is smaller
CROWDED = 30, 80  # objects, from which on a room must be larger, and must be as large as can be
KINDS = ("living", "dining", "bedroom", "study")


@dataclass(frozen=True)
class Room:
    """A room without furniture; attributes as in `description.interiors.Interior`.

    `kind` is one of KINDS, and says what the room is for.
    """

    size: tuple[float, float, float]
    openings: tuple[Opening, ...]
    hour: float
    facing_degrees: float
    lit: bool
    kind: str


def stepped(length: float) -> float:
    """Return the multiple of STEP next to a length."""
    return round(length / STEP) * STEP


def draw_room(draws: Draws, hours: tuple[float, float], objects: int) -> Room:
    """Draw a room of 3 to 6 m by 3 to 5 m by 2.4 to 3 m, that is neither empty nor crowded."""
    least = min(max((objects - CROWDED[0]) / (CROWDED[1] - CROWDED[0]), 0.0), 1.0)
    most = min(objects / FULL, 1.0)
    spans = (3 + 3 * least, 3 + 3 * most), (2.4, 3.0), (3 + 2 * least, 3 + 2 * most)
    size = tuple(stepped(draws.span(*span)) for span in spans)
    kind = draws.pick(KINDS, (4, 3, 2.5, 2))
    walls = draws.shuffled(WALLS)
    openings = [_door(draws, walls[0], wall_length(size, walls[0]))]  # type: ignore[arg-type]
    bottom = stepped(draws.pick((draws.span(0.75, 1.0), draws.span(0.35, 0.6)), (3, 1)))
    top = stepped(min(draws.span(2.05, 2.3), size[1] - 0.2))
    openings += _windows(draws, walls[1], wall_length(size, walls[1]), bottom, top)  # type: ignore[arg-type]
    if draws.chance(0.35):
        openings += _windows(draws, walls[2], wall_length(size, walls[2]), bottom, top)[:1]  # type: ignore[arg-type]
    hour = draws.span(*hours)
    dark = not 6.5 < hour < 17.5
    lit = draws.chance(1.0 if dark else 0.35)
    facing = draws.span(0.0, 360.0)
    return Room(size, tuple(openings), hour, facing, lit, kind)  # type: ignore[arg-type]


def _door(draws: Draws, wall: str, length: float) -> Opening:
    width = stepped(draws.span(0.8, 0.95))
    least, most = CORNER / 2, length - CORNER / 2 - width
    # Doors are mostly near a corner.
    left = stepped(draws.pick((least, most, draws.span(least, most)), (2, 2, 1)))
    return Opening("door", wall, left, left + width, 0.0, stepped(draws.span(1.98, 2.1)))


def _windows(draws: Draws, wall: str, length: float, bottom: float, top: float) -> list[Opening]:
    """Draw one window, or two equal ones, in a wall."""
    room = length - 2 * CORNER
    if room > 2.6 and draws.chance(0.45):
        width = stepped(draws.span(0.9, min(1.3, room / 2 - 0.35)))
        gap = stepped(draws.span(0.3, room - 2 * width))
        first = stepped((length - 2 * width - gap) / 2)
        lefts = [first, first + width + gap]
    else:
        width = stepped(draws.span(1.1, min(2.2, room)))
        lefts = [stepped(draws.span(CORNER, length - CORNER - width))]
    return [Opening("window", wall, left, left + width, bottom, top) for left in lefts]
