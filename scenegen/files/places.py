"""Places to write to: paths of this machine, and URLs such as `s3://bucket/rooms.h5`.

A URL is a `UPath`, which has the methods of a `Path` for any store that fsspec knows.
"""

import errno
import hashlib
import os
import re
import secrets
import shutil
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, cast

from scenegen.common.errors import SceneGenError

SEPARATOR = "://"
MOST_WAYS = 3  # by which `files_below` enters the same folder


def as_place(path: str | Path) -> Path:
    """Return a path, or a `UPath` for a URL.

    Raises SceneGenError where the extra `cluster` is not installed, and OSError for a URL of a kind
    that is not known.
    """
    if not isinstance(path, str):
        return path
    if SEPARATOR not in path:
        return Path(path)
    if re.match(r"[^/]+://[^/]*@", path):
        kind, expected = path.partition(SEPARATOR)[0], "a URL without one: the store has variables"
        raise SceneGenError(f"{kind}{SEPARATOR}...", "a user or a password", expected)
    try:
        from upath import UPath
    except ImportError as error:
        raise lacking(path, "universal_pathlib") from error
    try:
        place = UPath(path)
        return Path(place.path) if place.protocol == "file" else cast("Path", place)
    except ValueError as error:
        raise OSError(errno.EINVAL, f"cannot be written: {error}", path) from error


def lacking(where: object, package: str) -> SceneGenError:
    """Return the error for a package of the extra `cluster` that is not installed."""
    hint = "pip install 'pix2shape-bench[cluster]', and what fsspec needs for the store"
    return SceneGenError(where, f"no package {package} here", "", hint)


def is_remote(path: str | Path) -> bool:
    """Return whether a place is no path of this machine."""
    return SEPARATOR in path if isinstance(path, str) else not isinstance(path, Path)


def listing(folder: Path) -> list[Path]:
    """Return what is in a folder; nothing for a folder that is not there yet."""
    if is_remote(folder):
        cast("Any", folder).fs.invalidate_cache()
    try:
        return list(folder.iterdir())
    except (FileNotFoundError, NotADirectoryError):
        return []


def scratch(folder: Path) -> Path:
    """Return where files for a folder are written: there, or here for a remote one."""
    return Path(tempfile.gettempdir()) if is_remote(folder) else folder


def move(file: Path, place: Path) -> None:
    """Give a file its place, and replace an older one; a store copies it. Raises OSError."""
    remote = cast("Any", place)
    if not is_remote(place):
        os.replace(file, place)
    elif is_remote(file):
        with _told_by_store(place):
            remote.fs.mv(cast("Any", file).path, remote.path)
    else:
        upload(file, place)


def remove_folder(folder: Path) -> None:
    """Remove a folder and all that is in it, if it is there."""
    if not is_remote(folder):
        shutil.rmtree(folder, ignore_errors=True)
        return
    for path in listing(folder):
        path.unlink(missing_ok=True)


def files_below(folder: Path, pattern: str = "*") -> list[Path]:
    """Return the files in a folder and the folders below it, in order; links are followed.

    A file that several paths lead to comes once: with the first that matches, those without a link
    first. A link to a folder that it lies in is not followed. Longer circles end, as no folder is
    entered by more than MOST_WAYS.

    Args:
        pattern: of the path within the folder, with "/" before it; `*` stands for anything.
    """
    entered, files, roots = Counter[str](), dict[tuple[str, str], Path](), [folder]
    for root in roots:  # which grow: what links lead to comes after all else
        for place, folders, names in os.walk(root):
            real = os.path.realpath(place)
            entered[real] += 1
            if entered[real] > MOST_WAYS:
                folders.clear()
                continue
            folders.sort()
            links = (path for name in folders if (path := Path(place, name)).is_symlink())
            roots += [link for link in links if not Path(real).is_relative_to(link.resolve())]
            for name in names:
                path = Path(place, name)
                if fnmatchcase(f"/{path.relative_to(folder).as_posix()}", pattern):
                    files.setdefault((real, name), path)
    return sorted(path for path in files.values() if path.is_file())


def upload(file: Path, place: Path) -> None:
    """Copy a complete file to a remote place, and read it back.

    Raises OSError where the store refuses, or gives other bytes back.
    """
    remote = cast("Any", place)
    with _told_by_store(place):
        remote.fs.put_file(str(file), remote.path)
        with file.open("rb") as ours, place.open("rb") as theirs:
            same = _digest(ours) == _digest(theirs)
    if not same:
        raise OSError(errno.EIO, "the store returned other bytes than were uploaded", str(place))


def _digest(file: Any) -> bytes:
    return hashlib.file_digest(file, "sha256").digest()


def check_store(place: Path) -> None:
    """Raise OSError where nothing can be written beside a remote place.

    A small file is written and removed, so that a wrong bucket or missing credentials are known
    before a long run.
    """
    remote = cast("Any", place.with_name(f".{place.name}-{secrets.token_hex(4)}"))
    with _told_by_store(place):
        remote.fs.pipe_file(remote.path, b"\n")
        remote.fs.rm_file(remote.path)


@contextmanager
def _told_by_store(place: Path) -> Iterator[None]:
    """Raise what a store says as an OSError; each store has errors of its own."""
    try:
        yield
    except ImportError as error:
        raise lacking(place, error.name or str(error)) from error
    except Exception as error:
        number = error.errno if isinstance(error, OSError) and error.errno else errno.EIO
        text = " ".join(str(error).split())[:200] or os.strerror(number)
        text = f"cannot be written: {type(error).__name__}: {text}"
        raise OSError(number, text, str(place)) from error
