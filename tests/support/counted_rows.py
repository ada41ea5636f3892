"""A source of rows that costs nothing: row i holds i. Some rows raise, end the process or wait."""

import os
import signal
import time
from dataclasses import dataclass, field

from scenegen.common.errors import PlacementError
from scenegen.files.schema import Column
from scenegen.files.stream import RowStream

COLUMNS = {"row": Column("row", (), "int64"), "grid": Column("grid", (2, 3), "float32")}


@dataclass(frozen=True)
class Counted:
    together: int = 1
    refused: int = -1  # the row that cannot be made
    killed: int = -1  # the row at which the process is killed
    columns: dict = field(default_factory=lambda: COLUMNS)
    slow: float = 0.0  # seconds for a row

    def rows(self, numbers, processes):
        for number in numbers:
            time.sleep(self.slow)
            if number == self.refused:
                raise PlacementError(f"row {number}")
            if number == self.killed:
                os.kill(os.getpid(), signal.SIGKILL)
            yield {"row": number, "grid": [[number] * 3] * 2}


def counted(batch=4, start=0, stop=None, workers=0, rank=None, world_size=None, **how):
    """Return a stream of them; `shares` of several sources."""
    shares = how.pop("shares", [1.0])
    sources = [Counted(**how)] * len(shares)
    return RowStream(sources, shares, batch, start, stop, workers, rank, world_size)
