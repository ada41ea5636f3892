"""Scenes with models of the built-in families or of a folder of meshes."""

from dataclasses import replace
from pathlib import Path

from scenegen.description.names import FAMILY_NAMES
from scenegen.description.scenes import SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.objects.catalogue import Objects, mesh_objects
from scenegen.objects.meshes.folders import open_objects
from scenegen.objects.meshes.store import MeshStore
from scenegen.sampling.scenes import sample_scene

FAMILIES = DatasetSpec(
    height=33, width=47, source="families", shapes=FAMILY_NAMES, objects=(1, 3), seed=12,
    image_dtype="float32", shadows=True, min_visible_pixels=0,
)  # fmt: skip


def folder_objects(root: Path) -> Objects:
    return mesh_objects(MeshStore(open_objects(root), None))


def folder_spec(root: Path) -> DatasetSpec:
    listing = open_objects(root)
    return replace(FAMILIES, source="folder", shapes=listing.classes, listing=listing.digest())


def some_scenes(spec: DatasetSpec, objects: Objects, count: int) -> list[SceneSpec]:
    found = [sample_scene(spec, index, 0, objects) for index in range(4 * count)]
    return [scene for scene in found if scene][:count]
