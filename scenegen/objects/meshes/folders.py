"""Folders of models as listings: which classes there are, and which files. Nothing is loaded.

ShapeNetCore has its models up along +y; in version 1 they face +x, in version 2 -z.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from scenegen.objects.meshes.disk import existing, folders, meshes
from scenegen.objects.meshes.errors import MeshFolderError
from scenegen.objects.meshes.listing import ModelFile, ModelFolder, make_listing, object_split
from scenegen.objects.meshes.taxonomy import is_synset, official_splits, synset_names

__all__ = [
    "MeshFolderError",
    "ModelFile",
    "ModelFolder",
    "object_split",
    "open_models",
    "open_objects",
    "open_shapenet",
]
_INSIDE = {"shapenet-v1": "model.obj", "shapenet-v2": "models/model_normalized.obj"}
_DEPTH = 8  # folders below a class's that are looked into


def open_models(
    root: str | Path, classes: Sequence[str] | None = None, up: str = "y", split: str = "all"
) -> ModelFolder:
    """List a folder that is either ShapeNet's or a plain one; with z up it is taken for plain.

    Raises:
        MeshFolderError: as `open_shapenet`.
    """
    path = existing(root)
    if up == "y" and any(is_synset(name) for name in folders(path)) and _version(path):
        return open_shapenet(path, classes, split)
    return open_objects(path, classes, up, split)


def open_shapenet(
    root: str | Path, classes: Sequence[str] | None = None, split: str = "all"
) -> ModelFolder:
    """List ShapeNetCore, version 1 or 2, whichever lies there.

    Splits are the official ones where `all.csv` lies in the root (models that it does not name are
    in none of them), else those of `object_split`.

    Args:
        classes: names such as "mug", or synsets such as "03797390"; all that are there if None.
        split: "all", "train", "val" or "test".

    Raises:
        MeshFolderError: no such folder; not ShapeNet; an unknown class or split; nothing left.
    """
    root = existing(root)
    kind = _version(root)
    if kind is None:
        raise MeshFolderError(
            f"{root}: found no ShapeNet, expected <synset>/<id>/model.obj (version 1) or "
            "<synset>/<id>/models/model_normalized.obj (version 2), synset being 8 digits; "
            "name the folder that holds the synsets, or say --objects-root for a plain folder"
        )
    aliases, shown = synset_names(root), {}
    for synset in sorted(name for name in folders(root) if is_synset(name)):
        first = aliases.get(synset, (synset,))[0]
        shown[first if first not in shown else f"{first} {synset}"] = synset
    official = official_splits(root)

    def name_of(asked: str) -> str:
        also = (n for n, synset in shown.items() if asked in (synset, *aliases.get(synset, ())))
        return asked if asked in shown else next(also, asked)

    def models_of(name: str) -> Iterator[tuple[str, Path]]:
        folder = root / shown[name]
        return ((model_id, folder / model_id / _INSIDE[kind]) for model_id in folders(folder))

    def split_of(name: str, model_id: str) -> str | None:
        if official is None:
            return object_split(model_id)
        return official.get((shown[name], model_id))

    asked = None if classes is None else [name_of(name) for name in classes]
    return make_listing(root, kind, "y", sorted(shown), asked, split, models_of, split_of)


def open_objects(
    root: str | Path, classes: Sequence[str] | None = None, up: str = "y", split: str = "all"
) -> ModelFolder:
    """List a folder of OBJ, PLY, STL, GLB and OFF files, one class per sub-folder.

    A model's id is its path below its class's folder, without suffix (with it, where two files
    differ in nothing else). Hidden files, and links to folders inside a class, are passed over.

    Args:
        classes: names of sub-folders; all that hold meshes if None.
        up: the axis, "y" or "z", that points up in the files.
        split: "all", or "train", "val" or "test" by `object_split` of the ids.

    Raises:
        MeshFolderError: as `open_shapenet`.
    """
    root = existing(root)
    if up not in ("y", "z"):
        raise MeshFolderError(f"up: found {up!r}, expected y or z")
    names = sorted(folders(root))
    if not names:
        here = sum(1 for _ in meshes(root, 0))
        raise MeshFolderError(
            f"{root}: found no sub-folders{f' but {here} meshes' if here else ''}, expected one "
            "sub-folder per class; put the meshes into sub-folders named after their classes"
        )

    def models_of(name: str) -> Iterator[tuple[str, Path]]:
        folder = root / name
        files = [(path.relative_to(folder), path) for path in meshes(folder, _DEPTH)]
        ids = [below.with_suffix("").as_posix() for below, _ in files]
        times = Counter(ids)
        for model_id, (below, path) in zip(ids, files, strict=True):
            yield (below.as_posix() if times[model_id] > 1 else model_id), path

    return make_listing(
        root, "folder", up, names, classes, split, models_of, lambda _, i: object_split(i)
    )


def _version(root: Path) -> str | None:
    """Return the kind of ShapeNet by the first model found in either place."""
    for synset in sorted(folders(root)):
        if is_synset(synset):
            for model_id in sorted(folders(root / synset)):
                for kind, inside in _INSIDE.items():
                    if (root / synset / model_id / inside).is_file():
                        return kind
    return None
