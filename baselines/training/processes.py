"""A batch that several processes share: what each asks of the others, so that they learn as one.

Training gives each of N processes an equal part of every batch, in the order of the processes, and
averages their losses and gradients. That alone is right only for means over the images. Whatever
else mixes images, such as batch normalisation, asks for the whole batch here. With one process
nothing is asked, and no bit of what is computed changes.

The processes are those of torch's default group, which Lightning Fabric's launchers set up. All of
them have to call these functions equally often and in the same order.
"""

from typing import Any

import torch
from torch import Tensor, distributed, nn

from scenegen.common.errors import SceneGenError


class TrainingError(SceneGenError):
    """Training cannot go on: a loss is not finite, or memory is short."""


class LostProcessError(SceneGenError):
    """Another process of the run ended, or cannot be reached any more."""


def processes() -> int:
    """Return how many processes share every batch."""
    together = distributed.is_available() and distributed.is_initialized()
    return distributed.get_world_size() if together else 1


def is_first() -> bool:
    """Return whether this is the first of them, which alone writes files and shows progress."""
    return processes() == 1 or distributed.get_rank() == 0


def share(count: int) -> slice:
    """Return which of `count` items are this process's, where N processes share them evenly."""
    each = count // processes()
    first = each * distributed.get_rank() if processes() > 1 else 0
    return slice(first, first + each)


def _add_up(values: Tensor) -> None:
    """Replace values by their sum over the processes. Raises LostProcessError."""
    try:
        distributed.all_reduce(values)
    except RuntimeError as error:  # gloo and NCCL have no narrower one in common
        message = "that another process of this run exited or is unreachable"
        hint = "see the message of that process; `--resume` continues from the checkpoint"
        raise LostProcessError("training", message, hint=hint) from error


class _Sum(torch.autograd.Function):
    """The sum over the processes; its slope is the sum of the slopes that the processes found."""

    @staticmethod
    def forward(_ctx: Any, values: Tensor) -> Tensor:
        total = values.detach().clone(memory_format=torch.contiguous_format)
        _add_up(total)
        return total

    @staticmethod
    def backward(_ctx: Any, slope: Tensor) -> Any:
        return _Sum.apply(slope)  # type: ignore[no-untyped-call]


def summed(values: Tensor) -> Tensor:
    """Return the sum of the processes' values, the same in each; gradients flow to all of them.

    Raises LostProcessError.
    """
    if processes() == 1:
        return values
    total: Tensor = _Sum.apply(values)  # type: ignore[no-untyped-call]
    return total


def gathered(values: Tensor) -> Tensor:
    """Return the values of the whole batch, (B / N, ...) -> (B, ...); gradients flow to all.

    Raises LostProcessError.
    """
    if processes() == 1:
        return values
    whole = values.new_zeros(len(values) * processes(), *values.shape[1:])
    whole[share(len(whole))] = values
    return summed(whole)


def average(tensors: list[Tensor]) -> None:
    """Replace tensors of one type by their means over the processes, in one message.

    Raises LostProcessError.
    """
    if processes() == 1:
        return
    flat = torch.cat([values.flatten() for values in tensors])
    _add_up(flat)
    means = torch.split(flat / processes(), [values.numel() for values in tensors])
    for values, mean in zip(tensors, means, strict=True):
        values.copy_(mean.view_as(values))


class _WholeBatch(nn.modules.batchnorm._BatchNorm):
    """Batch normalisation by the mean and the variance of the whole batch.

    torch.nn.SyncBatchNorm does this on GPUs alone.
    """

    def forward(self, input: Tensor) -> Tensor:  # noqa: A002 (torch's name)
        """Normalise (B / N, C, ...) over all axes but the second."""
        if processes() == 1 or not self.training:
            return super().forward(input)
        with torch.autocast(input.device.type, enabled=False):
            values = input.float() if input.dtype == torch.bfloat16 else input
            axes = [axis for axis in range(values.dim()) if axis != 1]
            variance, mean = torch.var_mean(values, dim=axes, correction=0)
            parts = gathered(torch.stack([mean, variance])[None])  # (N, 2, C)
            mean = parts[:, 0].mean(dim=0)
            variance = parts[:, 1].mean(dim=0) + parts[:, 0].var(dim=0, correction=0)
            self._remember(mean, variance, values.numel() // len(mean) * processes())
            scale = torch.rsqrt(variance + self.eps)
            scale = scale * self.weight if self.affine else scale
            shift = self.bias - mean * scale if self.affine else -mean * scale
            places = (-1, *(1,) * (values.dim() - 2))
            return (values * scale.view(places) + shift.view(places)).to(input.dtype)

    @torch.no_grad()
    def _remember(self, mean: Tensor, variance: Tensor, count: int) -> None:
        """Move the running statistics, which prediction uses, as torch does."""
        assert self.running_mean is not None
        assert self.running_var is not None
        assert self.num_batches_tracked is not None
        assert self.momentum is not None
        self.running_mean.lerp_(mean, self.momentum)
        self.running_var.lerp_(variance * count / (count - 1), self.momentum)
        self.num_batches_tracked += 1


class BatchNorm1d(_WholeBatch, nn.BatchNorm1d):
    """`torch.nn.BatchNorm1d` of the whole batch, (B / N, C)."""


class BatchNorm2d(_WholeBatch, nn.BatchNorm2d):
    """`torch.nn.BatchNorm2d` of the whole batch, (B / N, C, H, W)."""
