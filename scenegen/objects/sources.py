"""Turn the command line's options on objects into `DatasetSpec` settings and a catalogue."""

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scenegen.common.errors import SpecError
from scenegen.common.records import check
from scenegen.description.presets import PRESETS
from scenegen.description.specs import BUILT_IN, Request
from scenegen.objects.cache import default_cache_dir
from scenegen.objects.catalogue import Objects, furnished_objects, mesh_objects, objects_of
from scenegen.objects.families.store import MEMBER_STORE
from scenegen.objects.meshes.as_furniture import OBJECT, family_like
from scenegen.objects.meshes.folders import open_objects
from scenegen.objects.meshes.listing import ModelFolder
from scenegen.objects.meshes.shapenet import open_shapenet
from scenegen.objects.meshes.store import MeshStore

USUALLY_UP = {".stl": "z", ".glb": "y"}  # as printers and CAD have it, and as glTF demands
COLORED = {
    ".ply": rb"property \w+ red\b",
    ".glb": rb'"(COLOR_0|baseColor(Texture|Factor)|diffuse(Texture|Factor))"',
    ".obj": rb"(?m)^v([ \t]+[-+.\deE]+){6}\s*$",
}
HEAD = 2**16  # bytes of a file that are searched for colours
NOTES_SHOWN = 5  # refused models that are named after a run


@dataclass(frozen=True, eq=False)
class ObjectSource:
    """The objects that the options of `scenegen render` ask for.

    Attributes:
        settings: arguments of `DatasetSpec`.
        objects: the catalogue; None if the objects are built in.
        store: the meshes, if they come from a folder.
        is_furniture: whether these furnish closed rooms.
    """

    settings: dict[str, Any] = field(default_factory=dict)
    objects: Objects | None = None
    store: MeshStore | None = None
    is_furniture: bool = False

    def notes(self, own_colors: bool = False) -> list[str]:
        """Return lines on the models refused so far, and those of `folder_notes`.

        In closed rooms they tell, too, which classes belong nowhere.
        """
        problems = sorted(self.store.problems.items()) if self.store else []
        lines = [f"note: {name} was passed over: {why}" for name, why in problems[:NOTES_SHOWN]]
        if len(problems) > NOTES_SHOWN:
            more = len(problems) - NOTES_SHOWN
            lines.append(f"note: and {more} more; `scenegen check-objects` lists all")
        if self.store is None:
            return lines
        if self.is_furniture:
            odd = [name for name in self.store.folder.classes if family_like(name) == OBJECT]
            named = f"{', '.join(odd[:NOTES_SHOWN])}{', ...' if odd[NOTES_SHOWN:] else ''}"
            told = f"note: small things, as no furniture is called so: {named}"
            lines += [told] if odd else []
        return lines + folder_notes(self.store.folder, own_colors or self.is_furniture)


def folder_notes(folder: ModelFolder, own_colors: bool = False) -> list[str]:
    """Return lines on what may surprise in a folder of meshes.

    They name files that are no models, formats in which another axis is usually up, and, unless
    objects keep their own, a model with colours. Of each class the first model is looked at.
    """
    reasons = (
        (folder.unused, "a file of the same name is used"),
        (folder.astray, "they are in no class's sub-folder"),
    )
    notes = [_unused_note(files, why) for files, why in reasons if files]
    paths = [file.path for files in folder.models.values() for file in files]
    for suffix, up in USUALLY_UP.items():
        count = sum(path.suffix.lower() == suffix for path in paths)
        if count and up != folder.up and folder.kind == "folder":
            usual = f"note: {folder.up} is up in {count} {suffix} files, which usually have {up} up"
            notes.append(f"{usual}; if objects lie on their side, use --up {up}")
    firsts = [files[0].path for files in folder.models.values() if files]
    colored = next(filter(_has_colors, () if own_colors else firsts), None)
    if colored:
        grey = f"note: {colored.name} has colours, which are not rendered"
        notes.append(f"{grey}; scenegen render --reflectance own shows them")
    return notes


def _has_colors(path: Path) -> bool:
    """Return whether a mesh file begins as files do whose colours are read."""
    pattern = COLORED.get(path.suffix.lower())
    with suppress(OSError):
        if pattern is not None and path.is_file():  # a pipe may have no end
            with path.open("rb") as file:
                return re.search(pattern, file.read(HEAD)) is not None
    return False


def _unused_note(files: Sequence[Path], why: str) -> str:
    names = ", ".join(path.name for path in files[:NOTES_SHOWN])
    more = ", ..." if len(files) > NOTES_SHOWN else ""
    return f"note: {len(files)} files not used, as {why}: {names}{more}"


def object_source(
    preset: str,
    *,
    shapes: tuple[str, ...] | None = None,
    classes: tuple[str, ...] | None = None,
    object_split: str | None = None,
    shapenet_root: str | None = None,
    objects_root: str | None = None,
    up: str = "y",
    cache_dir: str | None = None,
) -> ObjectSource:
    """Return the settings on objects that go on top of a preset's, and the models.

    Without `classes`, a folder gives those of the preset that it has, or else all that it has. In
    closed rooms it gives all that it has, and families stand where it has nothing alike.

    Raises:
        SpecError: settings that contradict one another.
        MeshFolderError: a folder without such models.
    """
    root = mesh_folder(shapenet_root, objects_root, up)
    if shapes is not None and (classes is not None or root):
        found = "--shapes with --classes or a folder of meshes"
        raise SpecError("objects", found, "one of them")
    split = {} if object_split is None else {"object_split": object_split}
    if shapes is not None:
        return ObjectSource({"source": "shapes", "shapes": shapes, **split})
    if root is None:
        MEMBER_STORE.use(cache_dir or default_cache_dir())
        families = {} if classes is None else {"source": "families", "shapes": classes}
        return ObjectSource({**families, **split})
    shapenet, part = shapenet_root is not None, object_split or "all"
    usual = PRESETS.get(preset, PRESETS["shapes"])
    wanted, interior = usual.settings.get("shapes", ()), usual.kind.interior
    if interior:
        folder = _open_own(root, shapenet, classes, up, part)
        taken = folder.classes if classes else tuple(map(family_like, folder.classes))
        names = (*folder.classes, *(n for n in classes or wanted if n not in taken))
    else:
        folder = _open(root, shapenet, classes, up, part)
        present = tuple(name for name in wanted if name in folder.classes)
        if classes is None and present:
            folder = _open(root, shapenet, present, up, part)
        names = folder.classes
    store = MeshStore(folder, cache_dir or default_cache_dir())
    settings = {"source": folder.kind, "shapes": names, "listing": folder.digest()}
    objects = furnished_objects(store, names, part) if interior else mesh_objects(store)
    return ObjectSource({**settings, **split}, objects, store, interior)


def mesh_folder(shapenet_root: str | None, objects_root: str | None, up: str) -> str | None:
    """Return the folder of meshes that the options name, or None.

    Raises SpecError where the options contradict one another.
    """
    both = bool(shapenet_root and objects_root)
    check(not both, "objects", "--shapenet-root and --objects-root", "one of them")
    if up != "y":
        with_shapenet = "'y' with --shapenet-root, where y is always up"
        check(not shapenet_root, "up", repr(up), with_shapenet)
        check(bool(objects_root), "up", f"{up!r} without a folder of meshes", "--objects-root")
    return shapenet_root or objects_root


def file_objects(
    spec: Request,
    *,
    shapenet_root: str | None = None,
    objects_root: str | None = None,
    up: str = "y",
    cache_dir: str | None = None,
) -> Objects:
    """Return the models that a file's scenes are made of.

    Raises:
        SpecError: they are meshes, and no folder is told, or one that holds others.
        MeshFolderError: a folder without such models.
    """
    folder_option = mesh_folder(shapenet_root, objects_root, up)
    if spec.source in BUILT_IN and folder_option:
        raise SpecError(
            "objects", f"the folder {folder_option}", "none: the file's objects are built in"
        )
    root = objects_root if spec.source == "folder" else shapenet_root
    if root is None:
        MEMBER_STORE.use(cache_dir or default_cache_dir())
        return objects_of(spec)
    is_shapenet, split = spec.source != "folder", spec.object_split
    if spec.interior:
        folder = _open_own(root, is_shapenet, spec.shapes, up, split)
    else:
        folder = _open(root, is_shapenet, spec.shapes, up, split)
    if (folder.kind, folder.digest()) != (spec.source, spec.listing):
        found = f"other models than the file's: {folder.kind}, listing {folder.digest()[:12]}"
        raise SpecError(root, found, f"{spec.source}, listing {spec.listing[:12]}")
    store = MeshStore(folder, cache_dir or default_cache_dir())
    return furnished_objects(store, spec.shapes, split) if spec.interior else mesh_objects(store)


def _open_own(
    root: str, shapenet: bool, classes: tuple[str, ...] | None, up: str, split: str
) -> ModelFolder:
    """Return the models of those classes that a folder has or that no family has."""
    found = _open(root, shapenet, None, up, split)
    if classes is None:
        return found
    families = BUILT_IN["families"]
    own = tuple(n for n in classes if n in found.classes or n not in families)
    check(bool(own), "classes", f"none that {root} has", f"some of {', '.join(found.classes)}")
    return _open(root, shapenet, own, up, split)


def _open(
    root: str, shapenet: bool, classes: tuple[str, ...] | None, up: str, split: str
) -> ModelFolder:
    check(len(set(classes or ())) == len(classes or ()), "classes", classes, "each name once")
    if shapenet:
        return open_shapenet(root, classes, split)
    return open_objects(root, classes, up, split)
