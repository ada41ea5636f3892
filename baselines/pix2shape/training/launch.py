"""The processes that train together: how many there are, and how Lightning Fabric starts them."""

import os
from dataclasses import dataclass
from typing import TypeVar

import torch
from lightning_fabric import Fabric

from baselines.pix2shape.network.shared_batch import LostProcessError, processes
from baselines.pix2shape.training.loop import TrainingError
from scenegen.common.errors import SpecError
from scenegen.common.records import check

T = TypeVar("T")
NUMBERS = {"32": "32-true", "bf16": "bf16-mixed"}  # as Lightning Fabric calls them
STARTED = "LOCAL_WORLD_SIZE"  # set by torchrun, and so by `fabric run`, which calls it


@dataclass(frozen=True)
class Machine:
    """Where and how training runs; none of this changes what is learned, up to rounding.

    Attributes:
        accelerator: as in Lightning Fabric.
        devices: processes on each machine, which share every batch; each GPU has its own.
        nodes: machines, on each of which somebody starts the training.
        workers: processes that read the data, for each process that trains.
        every: iterations between checkpoints, and between pictures.
    """

    accelerator: str = "auto"
    devices: int = 1
    nodes: int = 1
    workers: int = 1
    every: int = 500


def started_elsewhere() -> tuple[int, int]:
    """Return the processes on each machine and the machines that torchrun started; else (1, 1).

    Raises SpecError where the environment does not tell them.
    """
    if not torchrun():
        return 1, 1
    for name in (STARTED, "WORLD_SIZE"):
        told = os.environ.get(name, "")
        check(told.isdecimal() and int(told) > 0, name, repr(told), "a number, as torchrun sets it")
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


def launched(machine: Machine, precision: str = "32") -> Fabric:
    """Return a Fabric whose processes run and have met.

    Without torchrun or SLURM, Fabric runs this program again for each further process on this
    machine; so everything before this call happens in each of them.

    Args:
        precision: of the networks, a key of NUMBERS.

    Raises:
        SpecError: torchrun or SLURM started another number of processes.
        LostProcessError: the processes did not meet.
    """
    several = machine.devices * machine.nodes > 1
    try:
        fabric = Fabric(
            accelerator=machine.accelerator,
            devices=machine.devices,
            num_nodes=machine.nodes,
            strategy="ddp" if several or torchrun() else "auto",
            precision=NUMBERS[precision],  # type: ignore[arg-type]
        )
        if "LT_CLI_USED" not in os.environ:  # under `fabric run` it did so when it was made
            fabric.launch()
    except ValueError as error:
        found = f"{machine.devices} on each of {machine.nodes} machines"
        expected = "as many as torchrun or SLURM started"
        raise SpecError("devices", found, expected, error) from error
    except torch.distributed.DistError as error:
        raise LostProcessError("training", f"that the processes did not meet ({error})") from error
    return fabric


def check_agreement(fabric: Fabric, what: str, own: T) -> None:
    """Raise SpecError where this process would not train what the first one trains."""
    if processes() > 1 and fabric.broadcast(own) != own:
        expected = f"the {what} of the first process"
        raise SpecError("training", f"another {what} in process {fabric.global_rank}", expected)
