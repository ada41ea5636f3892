"""The listing of a folder's models, by class and split. No model file is opened for it."""

import hashlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from scenegen.common.names import check_choice
from scenegen.description.specs import SPLITS
from scenegen.objects.meshes.errors import MeshFolderError

SUFFIXES = (".obj", ".ply", ".stl", ".glb", ".off")


@dataclass(frozen=True)
class ModelFile:
    """One model: its name, "class/id", and its path."""

    name: str
    path: Path


@dataclass(frozen=True)
class ModelFolder:
    """The models of a folder.

    Attributes:
        kind: "shapenet-v1", "shapenet-v2" or "folder".
        up: the axis, "y" or "z", that points up in the files.
        classes: sorted, or in the order asked for.
        models: the models of the split by class, sorted by name.
        unused: files that differ from the file of a model in their suffix alone.
        astray: files beside the classes' folders, which are in no class.
        splits: of all files of these classes, by `object_split`; empty where splits are official.
    """

    kind: str
    up: str
    classes: tuple[str, ...]
    models: Mapping[str, tuple[ModelFile, ...]]
    unused: tuple[Path, ...] = ()
    astray: tuple[Path, ...] = ()
    splits: Mapping[Path, str | None] = field(default_factory=dict)

    def digest(self) -> str:
        """Return the SHA-256, as hex, of kind, up and all names in order, but not of the paths."""
        names = (file.name for name in self.classes for file in self.models[name])
        return hashlib.sha256("\n".join([self.kind, self.up, *names]).encode()).hexdigest()


def object_split(model_id: str) -> str:
    """Return "train" (70%), "val" (10%) or "test" (20%) for a model's id. The rule never changes.

    The first 8 bytes of the SHA-256 of the id (UTF-8) are read as a big-endian number and taken
    modulo 10: 0 to 6 is train, 7 is val, 8 and 9 are test.
    """
    digest = hashlib.sha256(model_id.encode()).digest()
    tenth = int.from_bytes(digest[:8], "big") % 10
    return "train" if tenth < 7 else "val" if tenth == 7 else "test"


def make_listing(
    root: Path,
    kind: str,
    up: str,
    known: Sequence[str],
    asked: Sequence[str] | None,
    split: str,
    models_of: Callable[[str], Iterable[tuple[str, Path]]],
    split_of: Callable[[str, str], str | None],
    check_splits: bool = True,
) -> ModelFolder:
    """Choose classes and models. Of several files with one id, the first by suffix is the model.

    Args:
        known: all classes, sorted.
        asked: the classes to take, among `known`; None for all that are not empty.
        models_of: gives (id, path) of a class's models.
        split_of: gives the split of (class, id).
        check_splits: whether files of equal content in two splits are an error.

    Raises:
        MeshFolderError: the class or split is unknown, or a class that was asked for, or every
            class, is empty, or two splits share an object.
    """
    check_choice("object split", split, SPLITS, MeshFolderError)
    on_disk = {_valid(name): name for name in known}  # classes may be asked for by their valid name
    asked = None if asked is None else [on_disk.get(name, name) for name in asked]
    unknown = [name for name in asked or () if name not in known]
    if unknown or (asked is not None and not asked):
        named = ", ".join(name for name in unknown if name)
        found = f"no class {named}" if named else "no class named"
        raise MeshFolderError(root, found, f"some of {', '.join(on_disk)}")
    models, others, splits, unused = {}, 0, {}, []
    for name in dict.fromkeys(known if asked is None else asked):
        by_id: dict[str, list[Path]] = {}
        for model_id, path in models_of(name):
            by_id.setdefault(_valid(model_id), []).append(path)
        files = []
        for model_id, paths in sorted(by_id.items()):
            path, *same = sorted(paths, key=_by_suffix)
            unused += same
            splits[path] = split_of(name, model_id)
            if split in ("all", splits[path]):
                files.append(ModelFile(f"{_valid(name)}/{model_id}", path))
        others += len(by_id) - len(files)
        if files:
            models[_valid(name)] = tuple(files)
        elif asked is not None:
            raise _no_models(f"{root}: class {name}", split, len(by_id))
    if not models:
        raise _no_models(root, split, others)
    if check_splits and split != "all":
        for first, second in shared_by_splits(splits):
            found = f"the same object is in two splits, {first} and {second}"
            raise MeshFolderError(root, found, hint="remove one of these equal files")
    told = splits if check_splits else {}
    return ModelFolder(kind, up, tuple(models), models, tuple(unused), (), told)


def _by_suffix(path: Path) -> tuple[int, str]:
    return SUFFIXES.index(path.suffix.lower()), path.name


def shared_by_splits(splits: Mapping[Path, str | None]) -> list[tuple[Path, Path]]:
    """Return pairs of files that are in different splits and have equal content.

    Only files as large as a file of another split are read.
    """
    by_size: dict[int, list[Path]] = {}
    for path in splits:
        with suppress(OSError):  # a file that cannot be read is refused when it is used
            by_size.setdefault(path.stat().st_size, []).append(path)
    pairs = []
    for size, paths in sorted(by_size.items()):
        if not size or len({splits[path] for path in paths}) < 2:
            continue
        first: dict[str, Path] = {}
        for path in paths:
            with suppress(OSError):
                other = first.setdefault(_sha256(path), path)
                if splits[other] != splits[path]:
                    pairs.append((other, path))
    return pairs


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _no_models(where: object, split: str, in_other_splits: int) -> MeshFolderError:
    if in_other_splits:
        found = f"no models in split {split!r}, {in_other_splits} in other splits"
        return MeshFolderError(where, found, hint="choose another split, or leave the class out")
    return MeshFolderError(where, "no models", f"files of {', '.join(SUFFIXES)} in sub-folders")


def _valid(name: str) -> str:
    """Return a file name that is not valid UTF-8 in a form that can be stored and printed."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def existing(root: str | Path) -> Path:
    """Return the path of a folder. Raises MeshFolderError where there is none."""
    path = Path(root)
    try:
        path = path.expanduser()
        if path.is_dir():
            return path
        problem = "is not a folder" if path.exists() else "no such folder"
    except OSError as error:
        problem = f"cannot be reached ({error.strerror})"
    except RuntimeError:  # "~name/x"
        problem = "there is no such user, or no home folder"
    raise MeshFolderError(f"{path}: {problem}", hint="name the folder that holds the models")


def subfolders(path: Path) -> Iterator[str]:
    """Yield the names of sub-folders, and of links to folders, except hidden ones.

    Raises MeshFolderError where the folder cannot be listed.
    """
    return (entry.name for entry in _entries(path) if _is_folder(entry))


def mesh_files(path: Path, depth: int, above: tuple[Path, ...] = ()) -> Iterator[Path]:
    """Yield the files with a mesh suffix, down to `depth` levels below.

    Links are followed, but not back into one of the folders `above`. Raises MeshFolderError where a
    folder cannot be listed.
    """
    above = (*above, path.resolve())
    for entry in _entries(path):
        if _is_folder(entry):
            if depth and not (entry.is_symlink() and Path(entry.path).resolve() in above):
                yield from mesh_files(Path(entry.path), depth - 1, above)
        elif entry.name.lower().endswith(SUFFIXES):
            yield Path(entry.path)


def _entries(path: Path) -> list[os.DirEntry[str]]:
    try:
        with os.scandir(path) as entries:
            return [entry for entry in entries if not entry.name.startswith(".")]
    except OSError as error:
        message = f"{path}: the folder cannot be read ({error.strerror})"
        hint = "give read permission, or move the folder away"
        raise MeshFolderError(message, hint=hint) from error


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:  # a link to itself
        return False
