"""Folders whose files appear together, or replace those of an older run together."""

import errno
import os
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from scenegen.common.signals import held_back
from scenegen.files.new_file import EXISTS, check_name, check_writable
from scenegen.files.workspace import remove_leftovers, workspace


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
        raise FileExistsError(errno.EEXIST, f"holds other files too ({strangers[0]})", str(folder))


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
