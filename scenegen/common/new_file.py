"""Files that appear under their name only when they are complete."""

import errno
import itertools
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_NUMBERS = itertools.count()


@contextmanager
def written_beside(path: str | Path, overwrite: bool = False) -> Iterator[Path]:
    """Give a hidden path in the same folder to write to; it is renamed when the block ends well.

    Whatever goes wrong, nothing is left under either name that was not there before. Raises OSError
    as `check_writable` or as the disk does, with `path` in place of the hidden path.
    """
    path = Path(path)
    check_writable(path, overwrite)
    temporary = path.with_name(f".{os.getpid()}-{next(_NUMBERS)}.partial{path.suffix[:8]}")
    try:
        yield temporary
        check_writable(path, overwrite)
        os.replace(temporary, path)
    except (OSError, RuntimeError) as error:
        reason = _reason(error)
        if reason is None or (isinstance(error, OSError) and str(error.filename) == str(path)):
            raise
        number = error.errno if isinstance(error, OSError) and error.errno else errno.EIO
        raise OSError(number, reason, str(path)) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str, overwrite: bool = False) -> None:
    """Write a text file as UTF-8, complete or not at all. Raises OSError as `written_beside`."""
    with written_beside(path, overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _reason(error: Exception) -> str | None:
    """Return why the disk refused, from an error of the system or of HDF5; None for others."""
    text = str(error)
    told = re.search(r"error message = '([^']*)'|Cannot open image file [^ ]* (.*)", text)
    if told:
        return f"cannot be written: {told.group(1) or told.group(2)}"
    if isinstance(error, OSError):
        return f"cannot be written: {error.strerror}" if error.strerror else None
    return None


def check_writable(path: Path, overwrite: bool) -> None:
    """Raise an OSError where a file cannot be written, so that it is known before a long run."""
    parent = path.parent
    problems = (
        (not parent.exists(), errno.ENOENT, "the folder does not exist; create it first", parent),
        (not parent.is_dir(), errno.ENOTDIR, "is not a folder", parent),
        (path.is_dir(), errno.EISDIR, "is a folder; name a file in it", path),
        (
            path.exists() and not overwrite,
            errno.EEXIST,
            "exists already; say --overwrite to replace it",
            path,
        ),
        (path.exists() and not path.is_file(), errno.EINVAL, "is not a regular file", path),
        (not os.access(parent, os.W_OK), errno.EACCES, "cannot be written to", parent),
    )
    for wrong, number, text, where in problems:
        if wrong:
            raise OSError(number, text, str(where))
