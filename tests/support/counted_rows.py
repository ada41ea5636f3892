"""A source of rows that costs nothing: row i holds i. Some rows raise, end the process or wait."""

import os
import signal
from functools import partial

from scenegen.common.errors import PlacementError
from scenegen.files.schema import Column
from scenegen.files.stream import RowStream

COLUMNS = {"row": Column("row", (), "int64"), "grid": Column("grid", (2, 3), "float32")}


def rows(refused, killed, numbers, processes):
    for number in numbers:
        if number == refused:
            raise PlacementError(f"row {number}")
        if number == killed:
            os.kill(os.getpid(), signal.SIGKILL)
        yield {"row": number, "grid": [[number] * 3] * 2}


def counted(batch=4, start=0, stop=None, workers=0, rank=None, world_size=None, **how):
    """Return a stream of them; row `refused` cannot be made, at row `killed` the process ends."""
    maker = partial(rows, how.get("refused", -1), how.get("killed", -1))
    makers = [(maker, share) for share in how.get("shares", [1.0])]
    together = how.get("together", 1)
    more = {name: how[name] for name in ("drop_last", "requests") if name in how}
    ranks = rank, world_size
    return RowStream(COLUMNS, makers, batch, start, stop, workers, *ranks, together, **more)
