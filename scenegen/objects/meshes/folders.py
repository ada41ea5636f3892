"""Folders of mesh files with one sub-folder per class; `open_models` also recognises ShapeNet."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from scenegen.objects.meshes.errors import MeshFolderError
from scenegen.objects.meshes.listing import (
    ModelFolder,
    existing,
    make_listing,
    mesh_files,
    object_split,
    subfolders,
)
from scenegen.objects.meshes.shapenet import open_shapenet, shapenet_version

_DEPTH = 8  # levels of folders below a class's folder that are searched


def open_models(
    root: str | Path, classes: Sequence[str] | None = None, up: str = "y", split: str = "all"
) -> ModelFolder:
    """List a folder that is either ShapeNet or a plain one; with up="z" it is always plain.

    Raises MeshFolderError as `open_shapenet` and `open_objects` do.
    """
    path = existing(root)
    if up == "y" and shapenet_version(path):
        return open_shapenet(path, classes, split)
    return open_objects(path, classes, up, split)


def open_objects(
    root: str | Path, classes: Sequence[str] | None = None, up: str = "y", split: str = "all"
) -> ModelFolder:
    """List a folder of OBJ, PLY, STL, GLB and OFF files with one sub-folder per class.

    An object's id is its path below its class's folder without the suffix. Files that differ in
    nothing else are one object: the first of OBJ, PLY, STL, GLB, OFF is read. Hidden files are
    ignored.

    Args:
        classes: names of sub-folders; None for all that hold meshes.
        up: the axis, "y" or "z", that points up in the files.
        split: "all", or "train", "val" or "test" by `object_split` of the ids.

    Raises:
        MeshFolderError: there is no such folder, class, axis or split, no model is left, or files
            of equal content are in two splits.
    """
    root = existing(root)
    if up not in ("y", "z"):
        raise MeshFolderError("up", repr(up), "y or z")
    names = sorted(subfolders(root))
    if not names:
        here = len(list(mesh_files(root, 0)))
        found = f"no sub-folders, but {here} meshes" if here else "an empty folder"
        hint = "put the meshes into sub-folders named after their classes"
        raise MeshFolderError(root, found, "one sub-folder per class", hint)

    def models_of(name: str) -> Iterator[tuple[str, Path]]:
        folder = root / name
        for path in mesh_files(folder, _DEPTH, (root.resolve(),)):
            yield path.relative_to(folder).with_suffix("").as_posix(), path

    listing = make_listing(
        root, "folder", up, names, classes, split, models_of, lambda _, i: object_split(i)
    )
    return replace(listing, astray=tuple(mesh_files(root, 0)))
