"""Arrays on the device. All arrays that NumPy made reach Dr.Jit and Mitsuba through this module.

On the CPU, Dr.Jit 1.5 uses NumPy's memory without a copy, and kernels read whole SIMD packets. So a
kernel may read up to one packet beyond the end of an array: where the next page is not mapped, the
process dies. `padded` therefore returns memory that is aligned and one packet longer.

Tables are arrays whose rows are gathered four floats at a time. Without that, a gather of what a
whole image shares takes one load for each ray and float, and most of a kernel's time where the
processor has no fast gathers.
"""

from collections.abc import Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

PACKET = 4
ALIGNMENT = 64  # bytes
SLACK = 128  # bytes behind the last element: the widest packet, 16 lanes of 8 bytes


def upload_table(rows: NDArray[Any]) -> Any:
    """Copy rows, (..., width), to the device as float32, each padded to whole packets.

    Dr.Jit gathers packets only from aligned data, and compiles another kernel for other data.
    """
    return upload_rows([rows.reshape(-1, rows.shape[-1])])[0]


def upload_rows(parts: Sequence[NDArray[Any]], kind: type = np.float32) -> tuple[Any, Any]:
    """Copy parts, (n, width) each, as one table; return it, and the first row of each part.

    `kind` is float32 or uint32. A table without rows gets one of zeros.
    """
    width = parts[0].shape[1] if parts else 1
    stride = -(-width // PACKET) * PACKET
    ends = np.cumsum([len(part) for part in parts], dtype=np.int64)
    count = max(1, int(ends[-1]) if parts else 0)
    table = _padded_zeros(count * stride, kind)
    rows = table.reshape(count, stride)
    for part, end in zip(parts, ends.tolist(), strict=True):
        rows[end - len(part) : end, :width] = part
    starts = ends - np.array([len(part) for part in parts], np.int64)
    return _on_device(table), starts


def upload(values: NDArray[Any], kind: type = np.float32) -> Any:
    """Copy values of any shape to the device, flat, as float32 or uint32; nothing becomes one 0."""
    return _on_device(padded(values if values.size else np.zeros(1), kind))


def padded(values: NDArray[Any], kind: type = np.float32) -> NDArray[Any]:
    """Return a flat copy, aligned and with SLACK behind it, that may be handed to Mitsuba."""
    copy = _padded_zeros(values.size, kind)
    copy.reshape(values.shape)[...] = values
    return copy


def _on_device(values: NDArray[Any]) -> Any:
    return (mi.Float if values.dtype == np.float32 else mi.UInt32)(values)


def _padded_zeros(count: int, kind: type) -> NDArray[Any]:
    size = count * np.dtype(kind).itemsize
    memory = np.zeros(ALIGNMENT + size + SLACK, np.uint8)
    start = -memory.ctypes.data % ALIGNMENT
    return memory[start : start + size].view(kind)


def gather_packet(table: Any, index: Any) -> Any:
    """Return four floats of each lane: those from 4 `index` on."""
    return dr.gather(mi.Vector4f, table, index)


def gather_row(table: Any, row: Any, width: int) -> list[Any]:
    """Return the `width` floats of each lane's row of a table with rows of that width."""
    count = -(-width // PACKET)
    packets = [gather_packet(table, row * count + i) for i in range(count)]
    return [packet[i] for packet in packets for i in range(PACKET)][:width]


def unit(vector: Any) -> Any:
    """Return vectors divided by their lengths, with the same bits on every processor.

    `dr.normalize` multiplies by the processor's own approximation of 1 / sqrt(x).
    """
    return vector / dr.sqrt(dr.dot(vector, vector))
