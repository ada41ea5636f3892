"""How Lightning Fabric starts the processes that train together."""

import os
from typing import TYPE_CHECKING, Any

import torch

from baselines.training.fit import TrainingError
from baselines.training.machine import Machine, chosen_device
from baselines.training.processes import LostProcessError, processes
from scenegen.common.errors import SpecError
from scenegen.common.records import check

if TYPE_CHECKING:
    from lightning_fabric import Fabric

PRECISIONS = {"32": "32-true", "bf16": "bf16-mixed"}  # of networks; as Lightning Fabric calls them
STARTED = "LOCAL_WORLD_SIZE"  # set by torchrun, and so by `fabric run`, which calls it


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
