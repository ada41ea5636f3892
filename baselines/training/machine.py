"""Where and how long a run trains, and how Lightning Fabric starts processes that train together.

What a run learns does not depend on where, up to rounding.
"""

import os
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import torch

from baselines.training.processes import LostProcessError, TrainingError, processes
from scenegen.common.errors import SpecError
from scenegen.common.records import check

PRECISIONS = {"32": "32-true", "bf16": "bf16-mixed"}  # of networks; as Lightning Fabric calls them
STARTED = "LOCAL_WORLD_SIZE"  # set by torchrun, and so by `fabric run`, which calls it


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
        raise SpecError("device", "no GPU that this torch can use", hint="use --device cpu")
    if name == "cpu" or not torch.cuda.is_available():
        return torch.device("cpu")
    check(count <= torch.cuda.device_count(), "devices", count, str(torch.cuda.device_count()))
    return torch.device("cuda")


if TYPE_CHECKING:
    from lightning_fabric import Fabric


def torchrun_counts() -> tuple[int, int]:
    """Return the processes on each machine and the machines that torchrun started; else (1, 1).

    Raises SpecError where the environment does not tell them.
    """
    if not torchrun():
        return 1, 1
    for name in (STARTED, "WORLD_SIZE"):
        text = os.environ.get(name, "")
        check(text.isdecimal() and int(text) > 0, name, repr(text), "a number, as torchrun sets it")
    devices = int(os.environ[STARTED])
    return devices, int(os.environ["WORLD_SIZE"]) // devices


def torchrun() -> bool:
    """Return whether torchrun started this process."""
    return STARTED in os.environ


def is_first_here() -> bool:
    """Return whether this is the first process, or the only one, of those on this machine."""
    return os.environ.get("LOCAL_RANK", "0") == "0"


def is_told_elsewhere(error: Exception) -> bool:
    """Return whether the first process on this machine tells the same error."""
    if is_first_here() or isinstance(error, LostProcessError):
        return False
    if processes() == 1:  # they have not met; each that torchrun started checked the same request
        return torchrun()
    return isinstance(error, TrainingError)


def launched(machine: Machine, precision: str = "32") -> "Fabric":
    """Return a Fabric whose processes run and have met.

    Without torchrun or SLURM, Fabric runs this program again for each further process on this
    machine; so everything before this call happens in each of them.

    Args:
        precision: of the networks, a key of PRECISIONS.

    Raises:
        SpecError: torchrun or SLURM started another number of processes, or a device is missing.
        LostProcessError: the processes did not meet.
    """
    from lightning_fabric import Fabric

    several = machine.devices * machine.nodes > 1
    device = chosen_device(machine.device, machine.devices)
    try:
        fabric = Fabric(
            accelerator="gpu" if device.type == "cuda" else "cpu",
            devices=machine.devices,
            num_nodes=machine.nodes,
            strategy="ddp" if several or torchrun() else "auto",
            precision=PRECISIONS[precision],  # type: ignore[arg-type]
        )
        if "LT_CLI_USED" not in os.environ:  # under `fabric run` it did so when it was made
            fabric.launch()
    except ValueError as error:
        count = f"{machine.devices} on each of {machine.nodes} machines"
        expected = "as many as torchrun or SLURM started"
        raise SpecError("devices", count, expected, error) from error
    except torch.distributed.DistError as error:
        message = f"that the processes did not meet ({error})"
        raise LostProcessError("training", message) from error
    return fabric


def check_agreement(fabric: "Fabric", what: str, value: Any) -> None:
    """Raise SpecError where this process would not train what the first one trains."""
    if processes() > 1 and fabric.broadcast(value) != value:
        expected = f"the {what} of the first process"
        raise SpecError("training", f"another {what} in process {fabric.global_rank}", expected)
