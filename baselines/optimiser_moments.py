"""The moments of Adam as named tensors, so that a checkpoint can hold them and training go on."""

from collections.abc import Mapping

import torch
from torch import Tensor
from torch.optim import Adam

MOMENTS = ("exp_avg", "exp_avg_sq", "step")


def moments_of(optimiser: Adam) -> tuple[dict[str, Tensor], str]:
    """Return the moments by name, and as a text how many parameters have any.

    Not every loss trains every parameter.
    """
    state = optimiser.state_dict()["state"]
    moments = {f"{i}.{name}": value for i, own in state.items() for name, value in own.items()}
    return moments, str(len(state))


def load_moments(optimiser: Adam, tensors: Mapping[str, Tensor], count: int) -> None:
    """Set the moments of an optimiser, of which `count` parameters have some.

    Raises KeyError, ValueError where moments are missing, unknown, of another shape, not finite
    or, where they cannot be, below 0.
    """
    parameters = optimiser.param_groups[0]["params"]
    moments: dict[int, dict[str, Tensor]] = {}
    numbers = {name.partition(".")[0] for name in tensors}
    strange = sorted(number for number in numbers if not number.isdecimal())
    _check(not strange, f"moments of parameter {', '.join(strange)[:40]!r}, not expected")
    for index in sorted(map(int, numbers)):
        _check(0 <= index < len(parameters), f"moments of parameter {index}, not expected")
        moments[index] = {}
        for field in MOMENTS:
            value = moments[index][field] = tensors[f"{index}.{field}"]
            shape = () if field == "step" else tuple(parameters[index].shape)
            found = f"{index}.{field}: {value.dtype}, shape {tuple(value.shape)}"
            ok = tuple(value.shape) == shape and value.dtype.is_floating_point
            _check(ok and bool(torch.isfinite(value).all()), f"{found}, not as its weights are")
            _check(field == "exp_avg" or bool((value >= 0).all()), f"{index}.{field} below 0")
    _check(len(moments) == count, f"moments of {len(moments)} parameters, expected {count}")
    _check(len(tensors) == count * len(MOMENTS), f"{len(tensors)} moments, not expected")
    groups = optimiser.state_dict()["param_groups"]
    optimiser.load_state_dict({"state": moments, "param_groups": groups})


def _check(ok: bool, found: str) -> None:
    if not ok:
        raise ValueError(found)
