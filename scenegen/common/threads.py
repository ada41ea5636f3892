"""Threads of libraries: code of many small products is slower with them, and its bits may change.

OpenBLAS and OpenMP start a thread for each processor. These spin while they wait for the next
product, and take the processors from the other processes and threads of the same work.
"""

from collections.abc import Iterator
from contextlib import contextmanager

# What processes get that are started here: libraries read it as they are loaded.
ONE_THREAD = {
    f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "NUMEXPR")
} | {"VECLIB_MAXIMUM_THREADS": "1"}


@contextmanager
def one_thread() -> Iterator[None]:
    """Let the libraries that are loaded use one thread: sums then have one order, too.

    A library that the block loads first is not among them. It takes some milliseconds.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        yield
