"""Small things, which stand on tables, shelves, sills and the floor until a room is full."""

from collections.abc import Sequence

from scenegen.description.interiors import WALLS
from scenegen.sampling.interiors.arranging import TURNS, Arranger, suits
from scenegen.sampling.interiors.spaces import ON, Box, box_at, stepped_turn

FILL_TRIES = 400
SILL_DEPTH = 0.14  # of a window's sill, inside the wall's plane
# What stands on what, by family and with weights; "sill" and "floor" are the room's.
ON_TOP: dict[str, dict[str, float]] = {
    "table": {"plate": 2, "cup": 3, "mug": 3, "bowl": 3, "bottle": 2, "can": 1, "vase": 2,
              "book": 2, "plant": 1, "cap": 0.3, "basket": 0.3},
    "coffee_table": {"book": 4, "cup": 2, "mug": 2, "vase": 2, "bowl": 2, "plant": 1, "can": 0.5},
    "desk": {"book": 4, "books": 3, "screen": 3, "lamp": 3, "mug": 3, "cup": 1, "can": 1,
             "plant": 1, "box": 0.5, "cap": 0.3, "bottle": 0.5},
    "shelf": {"books": 10, "book": 4, "vase": 2, "box": 1.5, "plant": 1.5, "bowl": 1, "cup": 1,
              "bottle": 0.5, "can": 0.5, "plate": 0.3, "basket": 1, "cap": 0.2, "mug": 0.7},
    "cabinet": {"lamp": 3, "vase": 3, "plant": 3, "books": 2, "book": 2, "bowl": 2, "screen": 1,
                "box": 0.5, "bottle": 0.5, "basket": 0.5},
    "nightstand": {"lamp": 4, "book": 3, "mug": 1, "cup": 1, "plant": 1, "bottle": 0.3},
    "sofa": {"cushion": 5, "book": 0.3, "bag": 0.2},
    "armchair": {"cushion": 2, "book": 0.2},
    "bed": {"cushion": 3, "book": 0.3, "bag": 0.2},
    "chair": {"bag": 0.5, "cap": 0.3, "book": 0.4},
    "stool": {"plant": 2, "book": 2, "mug": 1, "vase": 1},
    "sill": {"plant": 5, "vase": 2, "book": 0.5, "cup": 0.5, "bowl": 0.5},
    "floor": {"bag": 2, "box": 2, "basket": 2, "stool": 0.5},
}  # fmt: skip
SEATS = ("chair", "sofa", "armchair", "bed", "stool")
INSIDE = ("shelf",)  # families on all of whose surfaces things stand; others have a top
HIGHEST = 1.5  # metres of a top on which small things stand
MOST_LAMPS = 2  # on tables and the like; more of them burn a picture
MOST_ON_FLOOR = 5  # small things on the floor
UPRIGHT_FRONT = ("books", "screen", "cushion", "lamp")  # look to the front


def fill(arranger: Arranger) -> None:
    """Put small things on surfaces until the room holds what it should."""
    placed, known = arranger.space.placed, -1
    for left in range(FILL_TRIES, 0, -1):
        if arranger.space.full or len(placed) + left < arranger.space.most:
            return
        if len(placed) != known:  # since surfaces were looked for
            surfaces, known = _surfaces(arranger), len(placed)
        kind, parent, y, sides = arranger.draws.pick(
            [surface for surface, _ in surfaces], [weight for _, weight in surfaces]
        )
        weights = ON_TOP[kind]
        if arranger.other and kind not in SEATS:
            weights = {**weights, arranger.other: sum(weights.values())}
        family = arranger.draws.pick(tuple(weights), tuple(weights.values()))
        if kind == "floor":
            arranger.on_floor(family)
        elif kind == "sill":
            _on_sill(arranger, family, sides)
        else:
            _small(arranger, family, parent, y, sides)


def _surfaces(arranger: Arranger) -> list[tuple[tuple[str, int, float, Sequence[float]], float]]:
    """Return surfaces as (family, number, height, sides), with weights."""
    found: list[tuple[tuple[str, int, float, Sequence[float]], float]] = []
    carried = [thing.stands_on for thing in arranger.space.placed]
    for number, thing in enumerate(arranger.space.placed, start=1):
        family = thing.piece.family
        if family not in ON_TOP:
            continue
        top = max((surface[0] for surface in thing.piece.surfaces), default=0.0)
        for y, *sides in thing.piece.surfaces:
            if family not in INSIDE and ((y < top - 0.01 and family not in SEATS) or y > HIGHEST):
                continue
            area = (sides[1] - sides[0]) * (sides[3] - sides[2])
            weight = min(area, 0.8) * (0.3 if family in SEATS else 1.0)
            found.append(((family, number, y, sides), weight / (1 + 0.1 * carried.count(number))))
    for hole in arranger.room.openings:
        if hole.kind == "window":
            sill = (hole.left, hole.right, hole.bottom, float(WALLS.index(hole.wall)))
            found.append((("sill", 0, hole.bottom, sill), 0.08))
    astray = sum(
        t.piece.family in (*ON_TOP["floor"], arranger.other) and not t.stands_on
        for t in arranger.space.placed
    )
    if astray < MOST_ON_FLOOR:
        found.append((("floor", 0, 0.0, ()), 0.06))
    return found


def _small(arranger: Arranger, family: str, parent: int, y: float, sides: Sequence[float]) -> int:
    lamps = sum(thing.piece.family == "lamp" for thing in arranger.space.placed)
    if family == "lamp" and lamps >= MOST_LAMPS:
        return 0
    piece = arranger.piece(family)
    below = arranger.space.placed[parent - 1]
    if piece is None or _many(arranger, family, parent) or not suits(piece, below.piece):
        return 0
    place = below.box
    x0, x1, z0, z1 = sides
    for _ in range(4):
        turns = place.turns + stepped_turn(
            arranger.draws.span(-0.06, 0.06) if family in UPRIGHT_FRONT else arranger.draws.unit()
        )
        reach = Box(0, 0, piece.half, 0, 1, turns - place.turns).reach()
        if 2 * reach[0] > x1 - x0 or 2 * reach[1] > z1 - z0:
            continue
        x = arranger.draws.span(x0 + reach[0], x1 - reach[0])
        z = arranger.draws.span(z0 + reach[1], z1 - reach[1])
        if family == "cushion":
            z = z0 + reach[1]
        elif family == "books":
            z = min(z, z0 + reach[1] + 0.03)
        at = place.point(x, z)
        box = box_at(piece, *at, place.bottom + y + ON, turns)
        if arranger.stands(box, place, sides) and arranger.space.free(box, parent):
            return arranger.space.put(piece, box, parent)
    return 0


def _many(arranger: Arranger, family: str, parent: int) -> bool:
    """Return whether an object carries enough of a family."""
    most = {"screen": 1, "lamp": 1, "bag": 1, "cap": 1, "box": 3, "cushion": 4, "vase": 2,
            "basket": 2, "books": 12, "plate": 6}  # fmt: skip
    same = sum(
        thing.stands_on == parent and thing.piece.family == family
        for thing in arranger.space.placed
    )
    return same >= most.get(family, 4)


def _on_sill(arranger: Arranger, family: str, sides: Sequence[float]) -> int:
    left, right, height, wall = sides
    piece = arranger.piece(family)
    name = WALLS[int(wall)]
    if piece is None or max(piece.half) > SILL_DEPTH or piece.height > 0.5:
        return 0
    turns = TURNS[name]
    along = arranger.draws.span(left + piece.half[0], right - piece.half[0])
    x, z = arranger.wall_place(name, along, SILL_DEPTH - max(piece.half) * 0.98)
    box = box_at(piece, x, z, height + 0.015625 + ON, turns)
    # It may reach into the window's opening, which is as deep as the wall.
    return arranger.space.put(piece, box, 0) if arranger.space.free(box) else 0
