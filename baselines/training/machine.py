"""Where and how long a run trains. What it learns does not depend on where, up to rounding."""

import time
from dataclasses import dataclass, field

import torch

from scenegen.common.errors import SpecError
from scenegen.common.records import check


@dataclass(frozen=True)
class Machine:
    """Where and how long training runs.

    Attributes:
        device: "auto", "cpu" or "cuda".
        devices: processes on each machine, which share every batch; each GPU has its own.
        nodes: machines, on each of which somebody starts the training.
        workers: processes that read the data, for each process that trains.
        every: iterations between checkpoints, and between pictures.
        minutes: the schedule is set so that training ends so long after `started`; None for the
            iterations of the settings.
        started: as `time.monotonic` tells it; by default when this is made.
    """

    device: str = "auto"
    devices: int = 1
    nodes: int = 1
    workers: int = 1
    every: int = 100
    minutes: float | None = None
    started: float = field(default_factory=time.monotonic)

    def seconds_left(self) -> float:
        """Return how long training may still go on."""
        if self.minutes is None:
            return float("inf")
        return 60 * self.minutes - (time.monotonic() - self.started)


def chosen_device(name: str, count: int = 1) -> torch.device:
    """Return a device by name; "auto" is a GPU if there is one.

    Raises SpecError where there are fewer than `count`.
    """
    if name == "cuda" and not torch.cuda.is_available():
        raise SpecError("device", "no GPU that this torch can use", hint="say --device cpu")
    if name == "cpu" or not torch.cuda.is_available():
        return torch.device("cpu")
    check(count <= torch.cuda.device_count(), "devices", count, str(torch.cuda.device_count()))
    return torch.device("cuda")
