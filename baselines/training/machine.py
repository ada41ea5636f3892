"""Where and how long a run trains. What it learns does not depend on where, up to rounding."""

import time
from dataclasses import dataclass, field

import torch

from scenegen.common.errors import SpecError

PRECISIONS = ("32", "bf16")  # of networks


@dataclass(frozen=True)
class Machine:
    """Where and how long training runs.

    Attributes:
        device: "auto", "cpu" or "cuda".
        workers: processes that read the data.
        every: iterations between checkpoints, and between pictures.
        minutes: the schedule is set so that training ends so long after `started`; None for the
            iterations of the settings.
        started: as `time.monotonic` tells it; by default when this is made.
    """

    device: str = "auto"
    workers: int = 1
    every: int = 100
    minutes: float | None = None
    started: float = field(default_factory=time.monotonic)

    def seconds_left(self) -> float:
        """Return how long training may still go on."""
        if self.minutes is None:
            return float("inf")
        return 60 * self.minutes - (time.monotonic() - self.started)


def chosen_device(name: str) -> torch.device:
    """Return a device by name; "auto" is a GPU if there is one. Raises SpecError without one."""
    if name == "cuda" and not torch.cuda.is_available():
        raise SpecError("device", "no GPU that this torch can use", hint="use --device cpu")
    return torch.device("cpu" if name == "cpu" or not torch.cuda.is_available() else "cuda")
