"""What lies in folders, found without a look at any file that is not asked for."""

import os
from collections.abc import Iterator
from pathlib import Path

from scenegen.objects.meshes.errors import MeshFolderError

SUFFIXES = (".obj", ".ply", ".stl", ".glb", ".off")


def existing(root: str | Path) -> Path:
    """Return the path of a folder. Raises MeshFolderError where there is none."""
    path = Path(root).expanduser()
    try:
        if path.is_dir():
            return path
        kind = "is not a folder" if path.exists() else "no such folder"
    except OSError as error:
        kind = f"cannot be reached ({error.strerror})"
    raise MeshFolderError(f"{path}: {kind}; name the folder that holds the models")


def folders(path: Path) -> Iterator[str]:
    """Give the names of sub-folders and links to such, but for hidden ones.

    Raises:
        MeshFolderError: where the folder cannot be listed.
    """
    return (entry.name for entry in _entries(path) if _is_folder(entry, follow=True))


def meshes(path: Path, depth: int) -> Iterator[Path]:
    """Give the files of a known suffix, down to `depth` levels below; no link is followed down.

    Raises:
        MeshFolderError: where a folder cannot be listed.
    """
    for entry in _entries(path):
        if _is_folder(entry, follow=False):
            if depth:
                yield from meshes(Path(entry.path), depth - 1)
        elif entry.name.lower().endswith(SUFFIXES):
            yield Path(entry.path)


def _entries(path: Path) -> list[os.DirEntry[str]]:
    try:
        with os.scandir(path) as entries:
            return [entry for entry in entries if not entry.name.startswith(".")]
    except OSError as error:
        raise MeshFolderError(
            f"{path}: cannot be listed ({error.strerror}); allow it or move the folder away"
        ) from error


def _is_folder(entry: os.DirEntry[str], follow: bool) -> bool:
    try:
        return entry.is_dir(follow_symlinks=follow)
    except OSError:  # a link to itself
        return False
