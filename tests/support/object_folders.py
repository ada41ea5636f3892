"""`scenegen render` on a folder of meshes, and which of them a file shows."""

from collections.abc import Callable

import h5py
from click.testing import Result

SMALL = ("--size", 24, "--min-visible-pixels", 2, "--objects", "1-2", "--cache-dir", "cache")
Run = Callable[..., Result]


def render(run: Run, *options: object, count: int = 12) -> Result:
    result = run("render", "--n", count, *SMALL, *options)
    assert result.exit_code == 0, result.output
    return result


def models_of(path: str = "rooms.h5") -> list[str]:
    with h5py.File(path) as file:
        return [name.decode() for name in file["object/model"][:].ravel() if name]
