"""Places to write to: paths of this machine, and URLs such as `s3://bucket/rooms.h5`.

A URL is a `UPath`, which has the methods of a `Path` for any store that fsspec knows.
"""

import errno
import os
import secrets
from pathlib import Path
from typing import Any, cast

from scenegen.common.errors import SceneGenError

SEPARATOR = "://"


def as_place(path: str | Path) -> Path:
    """Return a path, or a `UPath` for a URL.

    Raises SceneGenError where the extra `cluster` is not installed, and OSError for a URL of a kind
    that is not known.
    """
    if not isinstance(path, str):
        return path
    if SEPARATOR not in path:
        return Path(path)
    try:
        from upath import UPath
    except ImportError as error:
        raise lacking(path, "universal_pathlib") from error
    try:
        return cast("Path", UPath(path))
    except ValueError as error:
        raise OSError(errno.EINVAL, f"cannot be written: {error}", path) from error


def lacking(where: object, package: str) -> SceneGenError:
    """Return the error for a package of the extra `cluster` that is not installed."""
    hint = "pip install 'pix2shape-bench[cluster]', and what fsspec needs for the store"
    return SceneGenError(where, f"no package {package} here", "", hint)


def is_remote(path: str | Path) -> bool:
    """Return whether a place is no path of this machine."""
    return SEPARATOR in path if isinstance(path, str) else not isinstance(path, Path)


def upload(file: Path, place: Path) -> None:
    """Copy a complete file to a remote place. Raises OSError where the store refuses."""
    remote = cast("Any", place)
    try:
        remote.fs.put_file(str(file), remote.path)
    except Exception as error:  # each store has errors of its own
        raise _refused(place, error) from error


def check_store(place: Path) -> None:
    """Raise OSError where nothing can be written beside a remote place.

    A small file is written and removed, so that a wrong bucket or missing credentials are known
    before a long run.
    """
    remote = cast("Any", place.with_name(f".{place.name}-{secrets.token_hex(4)}"))
    try:
        remote.fs.makedirs(cast("Any", place).parent.path, exist_ok=True)
        remote.fs.pipe_file(remote.path, b"\n")
        remote.fs.rm_file(remote.path)
    except ImportError as error:
        raise lacking(place, error.name or str(error)) from error
    except Exception as error:
        raise _refused(place, error) from error


def _refused(place: Path, error: Exception) -> OSError:
    number = error.errno if isinstance(error, OSError) and error.errno else errno.EIO
    text = " ".join(str(error).split())[:200] or os.strerror(number)
    return OSError(number, f"cannot be written: {type(error).__name__}: {text}", str(place))
