"""Memory that the C library keeps after it was freed."""

import ctypes
import functools
import sys
from collections.abc import Callable


def return_free_memory() -> None:
    """Give memory that is free back to the system; with glibc alone, as others do so themselves.

    Buffers of many sizes leave gaps in glibc's heap, which glibc keeps. A worker of interiors with
    images grew from 1.0 to 1.6 GB in 4,700 rooms. With this call 0.9 GB stay, over 5,000 rooms.
    """
    trim = _trim()
    if trim is not None:
        trim(0)


@functools.cache
def _trim() -> Callable[[int], int] | None:
    if sys.platform != "linux":
        return None
    found: Callable[[int], int] | None = getattr(ctypes.CDLL(None), "malloc_trim", None)
    return found
