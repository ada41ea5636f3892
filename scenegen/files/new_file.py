"""Files and folders that appear under their name only when they are complete."""

import errno
import os
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from scenegen.common.signals import held_back
from scenegen.files.places import as_place, is_remote, scratch, upload
from scenegen.files.sets.workspace import remove_leftovers, workspace

EXISTS = "already exists; use --overwrite to replace it"


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
    with workspace(scratch(path.parent), path) as folder:
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


@contextmanager
def folder_written_beside(
    path: str | Path, names: Collection[str], overwrite: bool = False
) -> Iterator[Path]:
    """Give a hidden folder for files of these names; they appear when the block ends well.

    A name that ends in "/" is that of a folder, which is replaced with all that it holds.

    A new folder gets its name in one step. An older folder stays, so that it may be a mount point
    or the working directory: its old files are removed, then the new ones get their names. A run
    that is killed in between leaves some files of one run, never files of both.

    Raises OSError as `check_folder` or as the disk does, with `path` in place of the hidden one.
    """
    check_folder(path, names, overwrite)
    folder = Path(path)
    with workspace(folder if folder.is_dir() else folder.parent, folder) as made:
        new = made / "new"
        new.mkdir()
        yield new
        check_folder(folder, names, overwrite, made.name)
        with held_back():
            if not folder.exists():
                os.rename(new, folder)
                return
            for name in names:
                if name.endswith("/"):
                    shutil.rmtree(folder / name, ignore_errors=True)
                else:
                    (folder / name).unlink(missing_ok=True)
            for name in os.listdir(new):
                os.replace(new / name, folder / name)


def check_folder(path: str | Path, names: Collection[str], overwrite: bool, own: str = "") -> None:
    """Raise an OSError where a folder cannot be written, or holds anything but files of `names`.

    What killed runs left in it is removed. `own` is the name of this run's workspace.
    """
    check_place(path)
    folder = Path(path)
    if not folder.exists():
        return
    if not overwrite:
        raise FileExistsError(errno.EEXIST, EXISTS, str(folder))
    remove_leftovers(folder)
    ours = {own, *(name.rstrip("/") for name in names if _is_there(folder, name))}
    strangers = sorted(set(os.listdir(folder)) - ours)
    if strangers:
        raise FileExistsError(errno.EEXIST, f"also holds other files ({strangers[0]})", str(folder))


def _is_there(folder: Path, name: str) -> bool:
    """Return whether a folder holds a file, or for a name with "/" at its end a folder."""
    path = folder / name
    return path.is_dir() and not path.is_symlink() if name.endswith("/") else path.is_file()


def check_place(path: str | Path) -> None:
    """Raise an OSError where no folder can be made, or files cannot be written to it."""
    check_name(path)
    folder = Path(path)
    if not folder.exists():
        check_writable(path, overwrite=False)
    elif not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "is a file; name a folder", str(folder))
    elif not os.access(folder, os.W_OK):
        raise PermissionError(errno.EACCES, "cannot be written to", str(folder))
