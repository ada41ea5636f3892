"""What Qhull says of the basic shapes, as data: to import it takes longer than to render a room.

    python -c "from scenegen.objects import basic_hulls; basic_hulls.write()"

writes the data anew, from Qhull. A test compares them.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
FILE = Path(__file__).with_suffix(".npz")


def kept(key: str, compute: Callable[[], Array]) -> Array:
    """Return the array that the data hold under a key; compute it if there is none."""
    table = _stored_arrays()
    if key not in table:
        table[key] = compute()
    return table[key]


@cache
def _stored_arrays() -> dict[str, Array]:
    """Return all that is kept, by key."""
    if not FILE.exists():
        return {}
    with np.load(FILE) as arrays:
        return dict(arrays)


def write() -> None:
    """Compute all arrays and write them, in a process that has made no shape yet."""
    from scenegen.description.scenes import SHAPE_NAMES
    from scenegen.objects.basic_shapes import unit_shape

    _stored_arrays().clear()
    for name in SHAPE_NAMES:
        unit_shape(name)
    np.savez_compressed(FILE, allow_pickle=False, **_stored_arrays())
