"""What Qhull says of the basic shapes, as data: to import it takes longer than to render a room.

`basic_shapes.write_hulls` writes the data anew, from Qhull. A test compares them.
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
    table = all_kept()
    if key not in table:
        table[key] = compute()
    return table[key]


@cache
def all_kept() -> dict[str, Array]:
    """Return all that is kept, by key."""
    if not FILE.exists():
        return {}
    with np.load(FILE) as arrays:
        return dict(arrays)
