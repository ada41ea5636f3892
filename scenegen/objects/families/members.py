"""The numbered members of each family: one unit shape per number, the same on every machine."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from scenegen.common.errors import SpecError
from scenegen.common.names import check_choice
from scenegen.objects.families import (
    bags,
    bottles,
    cans,
    caps,
    chairs,
    lamps,
    tables,
    vessels,
)
from scenegen.objects.families.home import (
    devices,
    paper,
    plants,
    seats,
    storage,
    tableware,
    textiles,
)
from scenegen.objects.families.parts.assembly import assemble
from scenegen.objects.families.parts.surfaces import Part
from scenegen.objects.solids import UnitShape

MEMBERS = 1000  # in each family
# Append only: a family's position in this table is part of its members' seeds.
_BUILDERS: dict[str, Callable[[np.random.Generator], list[Part]]] = {
    "bowl": vessels.bowl,
    "mug": vessels.mug,
    "bottle": bottles.bottle,
    "can": cans.can,
    "lamp": lamps.lamp,
    "bag": bags.bag,
    "cap": caps.cap,
    "chair": chairs.chair,
    "table": tables.table,
    "sofa": seats.sofa,
    "armchair": seats.armchair,
    "stool": seats.stool,
    "shelf": storage.shelf,
    "cabinet": storage.cabinet,
    "nightstand": storage.nightstand,
    "desk": storage.desk,
    "coffee_table": storage.coffee_table,
    "bed": textiles.bed,
    "cushion": textiles.cushion,
    "curtain": textiles.curtain,
    "rug": textiles.rug,
    "plate": tableware.plate,
    "cup": tableware.cup,
    "vase": tableware.vase,
    "basket": tableware.basket,
    "book": paper.book,
    "books": paper.books,
    "box": paper.box,
    "picture": paper.picture,
    "screen": devices.screen,
    "clock": devices.clock,
    "floor_lamp": devices.floor_lamp,
    "pendant": devices.pendant,
    "plant": plants.plant,
    "tall_plant": plants.tall_plant,
}
_ENTROPY = 0x5E1F_0B7E  # part of every member's seed, so it must never change


@lru_cache(maxsize=256)
def member_shape(family: str, member: int) -> UnitShape:
    """Return a family's member as a unit shape: +y is up, the front faces +z.

    Raises SpecError as `make_member`.
    """
    return make_member(family, member)


def make_member(family: str, member: int) -> UnitShape:
    """Return what `member_shape` returns, and do not keep it in memory.

    The member's random choices depend on the family and the number alone, not on the seed of a
    data set.

    Raises SpecError as `check_member`.
    """
    return assemble(f"{family}/{member:04d}", member_parts(family, member))


def member_parts(family: str, member: int) -> list[Part]:
    """Return the parts that `make_member` joins, in the builder's units."""
    rng = member_rng(family, member)
    return _BUILDERS[family](rng)


def member_rng(family: str, member: int, *purpose: int) -> np.random.Generator:
    """Return the generator of a member's shape, or of another purpose.

    Raises SpecError as `check_member`.
    """
    check_member(family, member)
    place = list(_BUILDERS).index(family)
    key = np.random.SeedSequence(_ENTROPY, spawn_key=(place, member, *purpose))
    return np.random.Generator(np.random.PCG64(key))


def check_member(family: str, member: int) -> None:
    """Raise SpecError for a family that is not known, or a number beyond MEMBERS - 1."""
    check_choice("family", family, tuple(_BUILDERS))
    if not 0 <= member < MEMBERS:
        raise SpecError(family, f"member {member}", f"0 to {MEMBERS - 1}")
