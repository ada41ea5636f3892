"""Folders of files that appear, or replace those of an older run, together."""

import ctypes
import errno
import os
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from scenegen.common.signals import held_back
from scenegen.files.new_file import EXISTS, check_name, check_writable
from scenegen.files.workspace import remove_leftovers, workspace

AT_FDCWD, RENAME_EXCHANGE = -100, 2  # of Linux


@contextmanager
def folder_written_beside(
    path: str | Path, names: Collection[str], overwrite: bool = False
) -> Iterator[Path]:
    """Give a hidden folder for files of these names; it gets its name when the block ends well.

    An older folder is exchanged with the new one in a single step. Where the system cannot do
    that, it is renamed first: a process that is killed right then leaves no folder, and never one
    with files of both runs. A folder that cannot be renamed (a mount point, the folder that the
    process is in, one whose parent cannot be written to) stays: its old files are removed first,
    then the new ones get their names.

    Raises OSError as `check_folder` or as the disk does, with `path` in place of the hidden one.
    """
    check_folder(path, names, overwrite)
    folder = Path(path)
    stays = folder.is_dir() and not _can_be_renamed(folder)
    with workspace(folder if stays else folder.parent, folder) as made:
        new = made / "new"
        new.mkdir()
        yield new
        check_folder(folder, names, overwrite, made.name)
        with held_back():  # else what is renamed by then might be removed with the hidden folder
            if stays:
                for name in names:
                    (folder / name).unlink(missing_ok=True)
                for name in os.listdir(new):
                    os.replace(new / name, folder / name)
            elif folder.is_dir():
                _replace(folder, new, made / "old")
            else:
                os.rename(new, folder)


def check_folder(path: str | Path, names: Collection[str], overwrite: bool, own: str = "") -> None:
    """Raise an OSError where a folder cannot be written, or holds anything but files of `names`.

    What killed runs left in it is removed. `own` is the name of this run's workspace.
    """
    folder = Path(path)
    check_name(path)
    if not folder.exists():
        check_writable(path, overwrite)
        return
    if not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "is a file; name a folder", str(folder))
    if not overwrite:
        raise FileExistsError(errno.EEXIST, EXISTS, str(folder))
    remove_leftovers(folder)
    ours = {own, *(name for name in names if (folder / name).is_file())}
    strangers = sorted(set(os.listdir(folder)) - ours)
    if strangers:
        raise FileExistsError(errno.EEXIST, f"holds other files too ({strangers[0]})", str(folder))
    if not os.access(folder, os.W_OK):
        raise PermissionError(errno.EACCES, "cannot be written to", str(folder))


def _can_be_renamed(folder: Path) -> bool:
    """Return whether a rename fails only because its target, made for this, is not empty."""
    if folder.samefile(os.curdir):
        return False
    with suppress(OSError), workspace(folder.parent, folder) as made, held_back():
        (made / "full" / "folder").mkdir(parents=True)
        try:
            os.rename(folder, made / "full")
        except OSError as error:
            return error.errno in (errno.ENOTEMPTY, errno.EEXIST)
        os.rename(made / "full", folder)  # some disk does replace folders that are not empty
        return True
    return False


def _replace(folder: Path, new: Path, old: Path) -> None:
    """Put a new folder in the place of an old one, which is moved away and keeps its files."""
    shutil.copymode(folder, new)
    if _exchanged(folder, new):
        return
    os.rename(folder, old)
    try:
        os.rename(new, folder)
    except OSError:
        os.rename(old, folder)
        raise


def _exchanged(one: Path, other: Path) -> bool:
    """Exchange two names in one step; return False where the system or the disk cannot do that."""
    try:
        rename = ctypes.CDLL(None).renameat2
    except (OSError, TypeError, AttributeError):
        return False
    names = (AT_FDCWD, os.fsencode(one), AT_FDCWD, os.fsencode(other))
    return bool(rename(*names, RENAME_EXCHANGE) == 0)
