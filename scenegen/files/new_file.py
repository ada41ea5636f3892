"""Files that appear under their name only when they are complete."""

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from scenegen.files.places import as_place, is_remote, upload
from scenegen.files.workspace import workspace

EXISTS = "exists already; say --overwrite to replace it"


@contextmanager
def written_beside(path: str | Path, overwrite: bool = False) -> Iterator[Path]:
    """Give a hidden path to write to; it is renamed to `path` when the block ends well.

    For a URL it is in the folder for temporary files, and is uploaded when the block ends.

    On any error nothing is left that was not there before. The next run in the folder removes what
    a killed one left. Raises OSError as `check_writable` or as the disk does, with `path` in place
    of the hidden path.
    """
    check_writable(path, overwrite)
    path = as_place(path)
    parent = Path(tempfile.gettempdir()) if is_remote(path) else path.parent
    with workspace(parent, path) as folder:
        temporary = folder / f"file{path.suffix[:8]}"
        yield temporary
        check_writable(path, overwrite)
        if is_remote(path):
            upload(temporary, path)
        elif overwrite:
            os.replace(temporary, path)
        else:
            _take_name(temporary, path)


def _take_name(temporary: Path, path: Path) -> None:
    """Give a file a name that is free; of two runs that want the same one, the second fails."""
    try:
        os.link(temporary, path)
    except FileExistsError as error:
        raise FileExistsError(errno.EEXIST, EXISTS, str(path)) from error
    except OSError:  # a disk without hard links
        os.replace(temporary, path)


def write_text(path: str | Path, text: str, overwrite: bool = False) -> None:
    """Write a text file as UTF-8, complete or not at all. Raises OSError as `written_beside`."""
    with written_beside(path, overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8")


def check_writable(path: str | Path, overwrite: bool) -> None:
    """Raise an OSError where a file cannot be written, so that it is known before a long run."""
    if is_remote(path):
        if not overwrite and as_place(path).exists():
            raise FileExistsError(errno.EEXIST, EXISTS, str(path))
        return
    check_name(path)
    path = Path(path)
    _refuse(path.is_dir(), errno.EISDIR, "is a folder; name a file in it", path)
    _refuse(path.exists() and not overwrite, errno.EEXIST, EXISTS, path)
    _refuse(path.exists() and not path.is_file(), errno.EINVAL, "is not a regular file", path)
    writable = os.access(path.parent, os.W_OK)
    _refuse(not writable, errno.EACCES, "cannot be written to", path.parent)


def check_name(path: str | Path) -> None:
    """Raise an OSError for a path that no file and no folder can be written to."""
    if not str(path):
        raise OSError(errno.ENOENT, "an output has an empty path; name it")
    path = Path(path)
    missing = "the folder does not exist; create it first"
    _refuse(not path.parent.exists(), errno.ENOENT, missing, path.parent)
    _refuse(not path.parent.is_dir(), errno.ENOTDIR, "is not a folder", path.parent)
    _refuse(path.is_symlink(), errno.ELOOP, "is a symbolic link; name what it leads to", path)


def _refuse(wrong: bool, number: int, text: str, path: Path) -> None:
    if wrong:
        raise OSError(number, text, str(path))
