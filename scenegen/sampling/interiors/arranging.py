"""Where furniture stands: along walls, about tables, on surfaces, on the floor.

A thing for which there is no place is left out, and another one is tried.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from scenegen.description.interiors import WALLS, Opening, wall_length
from scenegen.objects.furniture.shapes import Piece
from scenegen.sampling.interiors.draws import Draws
from scenegen.sampling.interiors.rooms import Room
from scenegen.sampling.interiors.spaces import (
    GAP,
    ON,
    Box,
    Space,
    apart,
    box_at,
    facing,
    stepped_turn,
)

TRIES = 12  # places that are tried for one thing
TURNS = {"west": 0.25, "east": 0.75, "north": 0.0, "south": 0.5}  # of fronts that face inwards
BEHIND = 0.03  # metres between a wall and what stands along it
DOOR_CLEAR, FRONT_CLEAR = 0.85, 0.55  # metres that stay free before doors and before furniture
RUG_TOP = 0.03  # metres, above all rugs
TELEVISION = 0.4  # metres, less than half the width of a television
TOP = 1.0  # least height of a wall's free part for a picture's lower edge


@dataclass
class Arranger:
    """A room while it is furnished.

    Attributes:
        room, space, draws: what it is, what is taken, and random numbers.
        member: returns a member of a family, or None if the data set has none of it.
        other: the family of things that belong nowhere, and so stand anywhere; "" for none.
        kinds: members that this room has, by family: a set of chairs is of one kind.
    """

    room: Room
    space: Space
    draws: Draws
    member: Callable[[str], Piece | None]
    other: str = ""
    kinds: dict[str, list[Piece]] = field(default_factory=dict)

    # Choosing

    def piece(self, family: str, most_kinds: int = 3) -> Piece | None:
        """Return a member of a family: one that the room has, or another one."""
        known = self.kinds.setdefault(family, [])
        if family == "picture":  # no two alike
            new = self.member(family)
            if new is None or any(new.name == other.name for other in known):
                return None
            known.append(new)
            return new
        if len(known) < most_kinds and (not known or self.draws.chance(0.6)):
            new = self.member(family)
            if new is not None:
                known.append(new)
            return new
        return self.draws.pick(known) if known else None

    def holes(self, wall: str) -> list[Opening]:
        """Return the openings of a wall."""
        return [hole for hole in self.room.openings if hole.wall == wall]

    # Along walls

    def wall_place(self, wall: str, along: float, away: float) -> tuple[float, float]:
        """Return the point, (x, z), at a distance from a wall."""
        width, _, depth = self.space.size
        return {
            "west": (away, along),
            "east": (width - away, along),
            "north": (along, away),
            "south": (along, depth - away),
        }[wall]

    def wall_box(self, piece: Piece, wall: str, along: float, bottom: float, behind: float) -> Box:
        """Return the box of a piece with its back to a wall."""
        x, z = self.wall_place(wall, along, piece.half[1] + behind)
        return box_at(piece, x, z, bottom, TURNS[wall])

    def fits_wall(self, wall: str, along: float, half: float, bottom: float, top: float) -> bool:
        """Return whether a part of a wall has no opening behind it."""
        margin = 0.09
        return all(
            along + half + margin <= hole.left
            or along - half - margin >= hole.right
            or top <= hole.bottom - 0.03
            or bottom >= hole.top + margin
            for hole in self.holes(wall)
        )

    def against_wall(
        self,
        family: str,
        walls: Sequence[str] = WALLS,
        front: float = FRONT_CLEAR,
        middle: bool = False,
        kinds: int = 2,
    ) -> int:
        """Put furniture along a wall, with a free strip before it; return its number, or 0."""
        piece = self.piece(family, kinds)
        if piece is None or self.space.full:
            return 0
        for _ in range(TRIES):
            wall = self.draws.pick(walls)
            length = wall_length(self.space.size, wall)
            least = piece.half[0] + 0.04
            if 2 * least > length:
                continue
            along = self.draws.pick(
                (self.draws.span(least, length - least), least, length - least), (3, 1, 1)
            )
            along = length / 2 if middle and self.draws.chance(0.5) else along
            if not self.fits_wall(wall, along, piece.half[0], 0.0, piece.height):
                continue
            box = self.wall_box(piece, wall, along, 0.0, BEHIND)
            x, z = self.wall_place(wall, along, 2 * piece.half[1] + BEHIND + front / 2)
            strip = Box(x, z, (piece.half[0], front / 2), RUG_TOP, 2.0, TURNS[wall])
            if self.space.free(strip) and (number := self.stand(piece, box)):
                self.space.kept.append(strip)
                return number
        return 0

    def on_wall(self, family: str, low: float, high: float, kinds: int = 4) -> int:
        """Hang something on a wall with its middle between two heights; return its number or 0."""
        piece = self.piece(family, kinds)
        if piece is None or self.space.full:
            return 0
        for _ in range(TRIES):
            wall = self.draws.pick(WALLS)
            length = wall_length(self.space.size, wall)
            least = piece.half[0] + 0.1
            if 2 * least > length:
                continue
            along = self.draws.span(least, length - least)
            bottom = self.draws.span(low, high) - piece.height / 2
            top = bottom + piece.height
            if top > self.space.size[1] - 0.15 or bottom < TOP:
                continue
            if not self.fits_wall(wall, along, piece.half[0] + 0.12, bottom, top):
                continue
            box = self.wall_box(piece, wall, along, bottom, 0.002)
            near = Box(box.x, box.z, (piece.half[0] + 0.08, piece.half[1] + 0.05),
                       bottom - 0.05, top + 0.05, box.turns)  # fmt: skip
            if self.space.free(near):
                before = self.wall_box(piece, wall, along, bottom, BEHIND)
                self.space.kept.append(before)
                return self.space.put(piece, box, 0)
        return 0

    def curtains(self) -> None:
        """Hang pairs of curtains that reach to the floor at the windows of some rooms."""
        windows = [hole for hole in self.room.openings if hole.kind == "window"]
        if not self.draws.chance(0.6):
            return
        low, high = max(hole.top for hole in windows) + 0.06, self.space.size[1] - 0.04
        for _ in range(TRIES):
            piece, above = self.member("curtain"), self.draws.span(0.015, 0.08)
            if piece is not None and low < piece.height + above < high:
                break
        else:
            return
        top = piece.height + above
        for hole in windows:
            length, pair = wall_length(self.space.size, hole.wall), []
            for side in (-1, 1):
                edge = hole.left if side < 0 else hole.right
                along = edge + side * (piece.half[0] - 0.08)
                box = self.wall_box(piece, hole.wall, along, top - piece.height, 0.17)
                if piece.half[0] < along < length - piece.half[0] and self.space.within(box, 0.0):
                    pair.append(box)
            room = len(pair) == 2 and len(self.space.placed) + 2 <= self.space.most
            if room and apart(pair[0], pair[1]) and all(map(self.space.free, pair)):
                for box in pair:
                    self.space.put(piece, box, 0)

    # On the floor

    def stand(self, piece: Piece, box: Box, keep: bool = True) -> int:
        """Let something stand on the floor, or on a rug if it is wholly there; return its number.

        It is 0 where there is no room.
        """
        found = self.standing(piece, box, keep)
        return self.space.put(piece, *found) if found else 0

    def standing(self, piece: Piece, box: Box, keep: bool = True) -> tuple[Box, int] | None:
        """Return where something stands on the floor or a rug, and the number of that; or None."""
        base, number = 0.0, 0
        for i, other in enumerate(self.space.placed, start=1):
            if other.piece.family != "rug" or _beside(box, other.box):
                continue
            if not _above(box, other.box):
                return None
            base, number = other.box.top + ON, i
        box = box_at(piece, box.x, box.z, base, box.turns)
        if not self.space.within(box) or not self.space.free(box, number, floor=keep):
            return None
        return box, number

    def on_floor(self, family: str, corner: bool = False, kinds: int = 2) -> int:
        """Put something on the floor near a wall, or into a corner; return its number or 0."""
        piece = self.piece(family, kinds)
        if piece is None or self.space.full:
            return 0
        for _ in range(TRIES):
            turns = stepped_turn(self.draws.unit())
            reach = Box(0, 0, piece.half, 0, 1, turns).reach()
            near = self.draws.shuffled((True, corner))
            x = self._toward_wall(self.space.size[0], reach[0] + 0.04, near[0])
            z = self._toward_wall(self.space.size[2], reach[1] + 0.04, near[1])
            if number := self.stand(piece, box_at(piece, x, z, 0.0, turns)):
                return number
        return 0

    def _toward_wall(self, length: float, margin: float, near: bool) -> float:
        share = self.draws.unit()
        if near:
            share = 0.15 * share if self.draws.chance(0.5) else 1 - 0.15 * share
        return margin + share * max(length - 2 * margin, 0.0)

    def rug(self, x: float, z: float, turns: float) -> int:
        """Lay a rug about a point, as far as it is free."""
        piece = self.piece("rug", 1)
        if piece is None or self.space.full:
            return 0
        for _ in range(TRIES):
            dx, dz = self.draws.span(-0.15, 0.15), self.draws.span(-0.15, 0.15)
            box = box_at(piece, x + dx, z + dz, 0.0, turns)
            if self.space.within(box) and self.space.free(box):
                return self.space.put(piece, box, 0)
        return 0

    def table_with_chairs(self) -> int:
        """Put a table into the room, perhaps on a rug, with chairs that face it."""
        table = self.piece("table", 1)
        if table is None or self.space.full:
            return 0
        width, _, depth = self.space.size
        for _ in range(TRIES):
            x = width / 2 + self.draws.span(-0.25, 0.25) * width
            z = depth / 2 + self.draws.span(-0.25, 0.25) * depth
            turns = self.draws.pick((0.0, 0.25)) + (
                stepped_turn(self.draws.span(-0.02, 0.02)) if self.draws.chance(0.3) else 0.0
            )
            around = Box(x, z, (table.half[0] + 0.5, table.half[1] + 0.5), 0.0, 0.8, turns)
            if not self.space.within(around, -0.2) or not self.space.free(around, floor=True):
                continue
            before = len(self.space.placed)
            if self.draws.chance(0.35):
                self.rug(x, z, turns)
            number = self.stand(table, box_at(table, x, z, 0.0, turns))
            if number and self._chairs(number):
                return number
            del self.space.placed[before:]
        return 0

    def _chairs(self, table: int) -> bool:
        """Put chairs and settings at a table; return whether two found room, if there are any."""
        place, chair = self.space.placed[table - 1].box, self.piece("chair", 1)
        if chair is None:
            return True
        seated = 0
        a, b = place.half
        seats: list[tuple[float, float, float, float]] = []
        for side in (-1.0, 1.0):
            count = max(1, min(int(2 * a / (2 * chair.half[0] + 0.12)), 3))
            seats += [((2 * i + 1 - count) * a / count, side * b, 0.0, side) for i in range(count)]
            if 2 * b > 2 * chair.half[0] + 0.1 and 2 * a > 1.1:
                seats.append((side * a, 0.0, side, 0.0))
        wanted = self.draws.count(2, max(2, len(seats)))
        for x, z, out_x, out_z in self.draws.shuffled(seats)[:wanted]:
            away = chair.half[1] + self.draws.span(0.02, 0.14)
            at = place.point(x + out_x * away, z + out_z * away)
            c, s = place.axes
            toward = facing(-(c * out_x + s * out_z), s * out_x - c * out_z)
            toward += stepped_turn(self.draws.span(-0.035, 0.035))
            if self.space.full or not self.stand(chair, box_at(chair, *at, 0.0, toward), False):
                continue
            seated += 1
            if self.draws.chance(0.6):
                self._setting(table, x, z)
        return seated > 1

    def _setting(self, table: int, x: float, z: float) -> None:
        """Lay a plate, and a cup or a mug beside it, before a chair."""
        plate = self.piece("plate", 1)
        place = self.space.placed[table - 1]
        if plate is None:
            return
        inside = 1 - (plate.half[1] + 0.05) / max(place.box.half)
        across = place.box.point(x * inside if x else x, z * (1 - 0.2 / place.box.half[1]))
        self.on_surface(plate, table, across)
        cup = self.piece(self.draws.pick(("cup", "mug")), 1)
        if cup is not None:
            beside = (
                across[0] + self.draws.span(-0.2, 0.2),
                across[1] + self.draws.span(-0.2, 0.2),
            )
            self.on_surface(cup, table, beside)

    def seat_at(self, desk: int) -> None:
        """Put a chair before a desk, facing it."""
        place, chair = self.space.placed[desk - 1].box, self.piece("chair", 2)
        if chair is None or self.space.full:
            return
        away = place.half[1] + chair.half[1] + self.draws.span(0.02, 0.12)
        at = place.point(self.draws.span(-0.15, 0.15), away)
        turns = place.turns + 0.5 + stepped_turn(self.draws.span(-0.05, 0.05))
        self.stand(chair, box_at(chair, *at, 0.0, turns), keep=False)

    def beside(self, number: int, family: str, side: int) -> int:
        """Put something beside furniture that stands along a wall; `side` is -1 or 1."""
        place, piece = self.space.placed[number - 1].box, self.piece(family, 1)
        if piece is None or self.space.full:
            return 0
        away = place.half[0] + piece.half[0] + self.draws.span(0.03, 0.1)
        x, z = place.point(side * away, -place.half[1] + piece.half[1])
        box = box_at(piece, x, z, 0.0, place.turns)
        for wall in WALLS:  # nothing tall before a window or a door
            if TURNS[wall] == place.turns and wall_length(self.space.size, wall) > 0:
                along = z if wall in ("west", "east") else x
                if not self.fits_wall(wall, along, piece.half[0], 0.0, piece.height):
                    return 0
        return self.stand(piece, box, keep=False)

    def in_corner(self, family: str) -> int:
        """Put something into a corner, turned towards the middle of the room."""
        piece = self.piece(family, 2)
        if piece is None or self.space.full:
            return 0
        width, _, depth = self.space.size
        for sx, sz in self.draws.shuffled(((-1, -1), (-1, 1), (1, -1), (1, 1))):
            away = max(piece.half) * 1.35 + self.draws.span(0.05, 0.3)
            x, z = (away if sx < 0 else width - away), (away if sz < 0 else depth - away)
            turns = facing(-sx, -sz) + stepped_turn(self.draws.span(-0.04, 0.04))
            if number := self.stand(piece, box_at(piece, x, z, 0.0, turns)):
                return number
        return 0

    def hang(self, family: str, x: float, z: float) -> int:
        """Hang something from the ceiling; return its number, or 0."""
        piece = self.piece(family, 1)
        if piece is None or self.space.full:
            return 0
        bottom = self.space.size[1] - piece.height - 0.002
        box = box_at(piece, x, z, bottom, 0.0)
        return self.space.put(piece, box, 0) if self.space.free(box) and bottom > 1.45 else 0

    def screen_on(self, number: int) -> int:
        """Put a screen on furniture, looking to its front."""
        screen, place = self.member("screen"), self.space.placed[number - 1]
        if screen is None or place.piece.height > 1.1 or not suits(screen, place.piece):
            return 0
        at = place.box.point(self.draws.span(-0.15, 0.15), -0.3 * place.box.half[1])
        return self.on_surface(screen, number, at, place.box.turns)

    # On surfaces

    def on_surface(
        self, piece: Piece, parent: int, at: tuple[float, float], turns: float | None = None
    ) -> int:
        """Put something on the highest surface of an object about a point of the world, (x, z)."""
        if self.space.full:
            return 0
        below = self.space.placed[parent - 1]
        turns = stepped_turn(self.draws.unit()) if turns is None else turns
        for y, *sides in reversed(below.piece.surfaces):
            box = box_at(piece, *at, below.box.bottom + y + ON, turns)
            if self.stands(box, below.box, sides) and self.space.free(box, parent):
                return self.space.put(piece, box, parent)
        return 0

    @staticmethod
    def stands(box: Box, place: Box, sides: Sequence[float]) -> bool:
        """Return whether a box stands wholly on a rectangle (x0, x1, z0, z1) of an object."""
        x0, x1, z0, z1 = sides
        x, z = place.local(box.x, box.z)
        reach = Box(x, z, box.half, 0.0, 1.0, box.turns - place.turns).reach()
        return (
            x0 <= x - reach[0] and x + reach[0] <= x1 and z0 <= z - reach[1] and z + reach[1] <= z1
        )


def suits(piece: Piece, below: Piece) -> bool:
    """Return whether a screen is a monitor on a desk, or a television elsewhere."""
    return piece.family != "screen" or (piece.half[0] < TELEVISION) == (below.family == "desk")


def _beside(box: Box, other: Box) -> bool:
    """Return whether two boxes are apart, seen from above."""
    flat = [Box(b.x, b.z, b.half, 0.0, 1.0, b.turns) for b in (box, other)]
    return apart(flat[0], flat[1], GAP)


def _above(box: Box, other: Box) -> bool:
    """Return whether a box is within another one, seen from above."""
    (a, b) = other.half
    local = (other.local(*corner) for corner in box.corners())
    return all(abs(x) <= a - 0.02 and abs(z) <= b - 0.02 for x, z in local)
