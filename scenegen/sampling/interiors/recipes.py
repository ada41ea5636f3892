"""What rooms hold, by what they are for.

First comes what a room is for, such as a table with its chairs; then what stands along walls and
hangs on them; then small things, until the room holds as many objects as it should.
"""

import math

from scenegen.description.interiors import WALLS
from scenegen.sampling.interiors.arranging import DOOR_CLEAR, TURNS, Arranger
from scenegen.sampling.interiors.small_things import fill
from scenegen.sampling.interiors.spaces import Box, box_at


def furnish(arranger: Arranger) -> None:
    """Fill a room with what it is for, and then with small things."""
    room, space, draws = arranger.room, arranger.space, arranger.draws
    for hole in room.openings:
        if hole.kind == "door":
            middle, half = (hole.left + hole.right) / 2, (hole.right - hole.left) / 2
            x, z = arranger.wall_place(hole.wall, middle, DOOR_CLEAR / 2)
            space.kept.append(Box(x, z, (half, DOOR_CLEAR / 2), 0.0, 2.0, TURNS[hole.wall]))
    small = max(3, space.most // 3)  # places for small things
    whole, space.most = space.most, space.most - small
    {"living": _living, "dining": _dining, "bedroom": _bedroom, "study": _study}[room.kind](
        arranger
    )
    arranger.curtains()
    for step in draws.shuffled(
        ("shelf", "cabinet", "picture", "tall_plant", "clock", "floor", "shelf", "picture",
         "floor_lamp", "armchair", "picture", "rug", "picture")
    ):  # fmt: skip
        if step == "picture":
            arranger.on_wall(step, 1.45, 1.75)
        elif step == "clock" and draws.chance(0.5):
            arranger.on_wall(step, 1.7, 2.0)
        elif step in ("shelf", "cabinet"):
            arranger.against_wall(step, front=0.75)
        elif step == "floor":
            arranger.on_floor(draws.pick(("box", "bag", "basket", "stool")))
        elif step in ("tall_plant", "floor_lamp"):
            arranger.on_floor(step, corner=True)
        elif step == "armchair" and draws.chance(0.3):
            arranger.in_corner(step)
        elif step == "rug" and not arranger.kinds.get("rug") and draws.chance(0.5):
            width, _, depth = space.size
            x, z = draws.span(0.3, 0.7) * width, draws.span(0.3, 0.7) * depth
            arranger.rug(x, z, draws.pick((0.0, 0.25)))
    space.most = whole
    fill(arranger)


def _living(arranger: Arranger) -> None:
    """Put a sofa along a wall, a table before it on a rug, and a screen opposite."""
    draws, space = arranger.draws, arranger.space
    sofa = arranger.against_wall("sofa", front=0.9, middle=True)
    if not sofa:
        arranger.table_with_chairs()
        return
    box = space.placed[sofa - 1].box
    space.kept.pop()
    if draws.chance(0.7):
        arranger.rug(*box.point(0.0, box.half[1] + 0.8), box.turns)
    table = arranger.piece("coffee_table", 1)
    if table is not None and draws.chance(0.85):
        for away in (0.38, 0.5, 0.3, 0.65, 0.8):
            x, z = box.point(draws.span(-0.1, 0.1), box.half[1] + away + table.half[1])
            if arranger.stand(table, box_at(table, x, z, 0.0, box.turns)):
                break
    for side in draws.shuffled((-1, 1)):
        if draws.chance(0.45):
            arranger.beside(sofa, draws.pick(("floor_lamp", "tall_plant", "nightstand")), side)
    opposite = [w for w in WALLS if math.isclose(abs(TURNS[w] - box.turns), 0.5)]
    cabinet = arranger.against_wall("cabinet", opposite, middle=True)
    if cabinet and draws.chance(0.8):
        any(arranger.screen_on(cabinet) for _ in range(4))
    if draws.chance(0.4):
        arranger.in_corner("armchair")
    if draws.chance(0.4):
        arranger.table_with_chairs()


def _dining(arranger: Arranger) -> None:
    """Put a table with chairs below a lamp, and a cabinet along a wall."""
    table = arranger.table_with_chairs()
    if table and arranger.draws.chance(0.6):
        box = arranger.space.placed[table - 1].box
        arranger.hang("pendant", box.x, box.z)
    arranger.against_wall("cabinet", middle=True)


def _bedroom(arranger: Arranger) -> None:
    """Put a bed with its head to a wall, with night stands, and a cabinet."""
    bed = arranger.against_wall("bed", front=0.5, middle=True)
    if bed:
        for side in (-1, 1):
            if arranger.draws.chance(0.8):
                arranger.beside(bed, "nightstand", side)
        if arranger.draws.chance(0.4):
            box = arranger.space.placed[bed - 1].box
            arranger.rug(*box.point(0.0, box.half[1] + 0.7), box.turns)
    arranger.against_wall("cabinet")
    if arranger.draws.chance(0.5):
        _desk(arranger)


def _study(arranger: Arranger) -> None:
    """Put a desk with a chair along a wall, a shelf, and perhaps a sofa."""
    _desk(arranger)
    arranger.against_wall("shelf", front=0.75)
    if arranger.draws.chance(0.4):
        arranger.against_wall("sofa", front=0.6)


def _desk(arranger: Arranger) -> None:
    """Put a desk along a wall with a screen on it, and a chair before it."""
    desk = arranger.against_wall("desk", front=0.9)
    if desk:
        arranger.seat_at(desk)
        if arranger.draws.chance(0.8):
            any(arranger.screen_on(desk) for _ in range(4))
