"""A listing of models, by class and split."""

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from scenegen.description.specs import SPLITS
from scenegen.objects.meshes.disk import SUFFIXES
from scenegen.objects.meshes.errors import MeshFolderError


@dataclass(frozen=True)
class ModelFile:
    """One model: its name, "class/id", and where it lies."""

    name: str
    path: Path


@dataclass(frozen=True)
class ModelFolder:
    """A listing of models.

    Attributes:
        kind: "shapenet-v1", "shapenet-v2" or "folder".
        up: the axis, "y" or "z", that points up in the files.
        classes: sorted, or in the order asked for.
        models: by class, sorted by name; only those of the split.
    """

    kind: str
    up: str
    classes: tuple[str, ...]
    models: Mapping[str, tuple[ModelFile, ...]]

    def digest(self) -> str:
        """Return the SHA-256, as hex, of kind, up and all names in order; not of the paths."""
        names = (file.name for name in self.classes for file in self.models[name])
        return hashlib.sha256("\n".join([self.kind, self.up, *names]).encode()).hexdigest()


def object_split(model_id: str) -> str:
    """Return "train" (70%), "val" (10%) or "test" (20%) for an id, the same for ever.

    The first 8 bytes of the id's SHA-256 (UTF-8), as a big-endian number modulo 10: 0 to 6 is
    train, 7 val, 8 and 9 test.
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
) -> ModelFolder:
    """Choose classes and models.

    Args:
        known: all classes, sorted.
        asked: the ones wanted, of `known`; all that are not empty if None.
        models_of: gives (id, path) of a class's models.
        split_of: gives the split of (class, id).

    Raises:
        MeshFolderError: an unknown class or split; a class that was asked for, or all, is empty.
    """
    if split not in SPLITS:
        raise MeshFolderError(f"object split: found {split!r}, expected one of {', '.join(SPLITS)}")
    on_disk = {_valid(name): name for name in known}  # what was asked for may be what was stored
    asked = None if asked is None else [on_disk.get(name, name) for name in asked]
    unknown = [name for name in asked or () if name not in known]
    if unknown or (asked is not None and not asked):
        raise MeshFolderError(
            f"{root}: found no class {', '.join(unknown) or '(none was named)'}; "
            f"there are {', '.join(on_disk)}"
        )
    models, others = {}, 0
    for name in dict.fromkeys(known if asked is None else asked):
        found = sorted((_valid(model_id), path) for model_id, path in models_of(name))
        files = tuple(
            ModelFile(f"{_valid(name)}/{model_id}", path)
            for model_id, path in found
            if split == "all" or split_of(name, model_id) == split
        )
        others += len(found) - len(files)
        if files:
            models[_valid(name)] = files
        elif asked is not None:
            some = f", {len(found)} in others" if found else f" (of {', '.join(SUFFIXES)})"
            raise MeshFolderError(
                f"{root}: class {name} has no models in split {split!r}{some}; "
                "leave the class out or choose another split"
            )
    if not models:
        raise MeshFolderError(
            f"{root}: found no models in split {split!r}, {others} in others; choose another split"
            if others
            else f"{root}: found no models, expected files of {', '.join(SUFFIXES)} in sub-folders"
        )
    return ModelFolder(kind, up, tuple(models), models)


def _valid(name: str) -> str:
    """Return a name that is not UTF-8 on disk in a form that can be stored and printed."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
