"""The catalogue of a data set's objects: its classes, the models of each, and their shapes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

from scenegen.common.errors import SpecError
from scenegen.common.recent import recent
from scenegen.description.names import SHAPE_NAMES
from scenegen.description.scenes import SceneSpec
from scenegen.description.specs import Request
from scenegen.objects.basic_shapes import unit_shape
from scenegen.objects.cast_meshes import cast_mesh
from scenegen.objects.families.members import MEMBERS, member_shape
from scenegen.objects.families.store import MEMBER_STORE
from scenegen.objects.furniture.furnishing import furnishing
from scenegen.objects.furniture.room_shell import PREFIX, shell_shape
from scenegen.objects.furniture.shapes import furniture_shape
from scenegen.objects.meshes.as_furniture import family_like, mesh_furniture
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.listing import object_split
from scenegen.objects.meshes.store import MeshStore
from scenegen.objects.solids import Mesh, UnitShape, outline_of


@dataclass(frozen=True, eq=False)
class Objects:
    """The models that a data set's scenes are made of.

    Attributes:
        models: names of models, as in `scenes.PlacedObject.shape`, by class.
        shape: returns the unit shape of a name; raises BadMeshError if its file cannot be used.
        digest: returns the content hash of a model's file; empty for built-in objects.
        problems: reasons, by name, why models were refused so far.
    """

    models: Mapping[str, Sequence[str]]
    shape: Callable[[str], UnitShape]
    digest: Callable[[str], str]
    problems: dict[str, str] = field(default_factory=dict)


def objects_of(spec: Request) -> Objects:
    """Return the built-in objects of a data set.

    Raises:
        SpecError: the objects are meshes in a folder, and the spec does not hold its path.
    """
    if spec.source not in ("shapes", "families"):
        option = f"--{'objects' if spec.source == 'folder' else 'shapenet'}-root"
        raise SpecError("objects", f"meshes ({spec.source})", f"their folder, by {option}")
    found = _built_in(spec.source, spec.shapes, spec.object_split)
    return replace(found, shape=interior_shape) if spec.interior else found


def mesh_objects(store: MeshStore) -> Objects:
    """Return the objects of a folder of meshes."""
    return Objects(_listed(store), store.shape, store.digest, store.problems)


def furnished_objects(store: MeshStore, names: Sequence[str], split: str) -> Objects:
    """Return furniture: models of a folder, and members of those classes that it lacks."""
    families = tuple(name for name in names if name not in store.folder.models)
    members = _built_in("families", families, split).models
    furniture = _Furniture(store)
    return Objects({**_listed(store), **members}, furniture.shape, furniture.digest, store.problems)


@lru_cache(maxsize=16)
def furniture_models(objects: Objects) -> Mapping[str, Sequence[str]]:
    """Return the names of models by the family in whose place they stand, which may be OBJECT."""
    found: dict[str, Sequence[str]] = {}
    for name, models in objects.models.items():
        family = family_like(name)
        found[family] = [*found[family], *models] if family in found else models
    return found


def _listed(store: MeshStore) -> dict[str, Sequence[str]]:
    return {name: [file.name for file in files] for name, files in store.folder.models.items()}


@dataclass(frozen=True, eq=False)
class _Furniture:
    """Models of a folder, and members of other families, as furniture."""

    store: MeshStore

    def shape(self, name: str) -> UnitShape:
        return _kept(self, name) if self._is_own(name) else interior_shape(name)

    def digest(self, name: str) -> str:
        return self.store.digest(name) if self._is_own(name) else ""

    def _is_own(self, name: str) -> bool:
        return name.partition("/")[0] in self.store.folder.models


@recent(250_000_000)  # bytes: some 400 built-in pieces, more than the rooms of a street show
def _kept(furniture: _Furniture | None, name: str) -> UnitShape:
    """Return a piece of furniture, of a folder's models or of a family's members."""
    if furniture is None:
        shape = furniture_shape(name, furnishing(*_family_and_number(name)))
    else:
        shape = mesh_furniture(furniture.store, name)
    _ = shape.mesh  # made now, so that it counts
    return shape


def changed_meshes(objects: Objects, scene: SceneSpec) -> list[str]:
    """Return the names of a scene's models whose files have changed since it was rendered."""
    wrong = []
    for item in scene.objects:
        try:
            same = objects.digest(item.shape) == item.mesh
        except BadMeshError:
            same = False
        if not same:
            wrong.append(item.shape)
    return wrong


def interior_shape(name: str) -> UnitShape:
    """Return a member of a family as furniture, or the shell of a closed room.

    Raises SpecError for any other name.
    """
    return shell_shape(name) if name.startswith(PREFIX) else _kept(None, name)


def built_in_shape(name: str) -> UnitShape:
    """Return a basic shape or a member of a family. Raises SpecError for any other name."""
    return unit_shape(name) if name in SHAPE_NAMES else member_shape(*_family_and_number(name))


def _family_and_number(name: str) -> tuple[str, int]:
    family, _, member = name.partition("/")
    if not member.isdecimal() or len(member) > 4:
        raise SpecError("object", repr(name), "a basic shape, or family/number")
    return family, int(member)


def outline(shape_of: Callable[[str], UnitShape], name: str) -> UnitShape:
    """Return a unit shape's outline, as from `outline_of`; that of a basic shape is all of it."""
    return _known(shape_of, name)[0]


def face_count(shape_of: Callable[[str], UnitShape], name: str) -> int:
    """Return how many triangles of a unit shape are cast, without keeping them in memory."""
    if name.startswith(PREFIX):  # each room has a shell of its own, which is not asked for again
        return len(shape_of(name).mesh.faces)
    return _known(shape_of, name)[1]


def mesh_to_cast(shape_of: Callable[[str], UnitShape], name: str) -> Mesh:
    """Return a mesh as from `cast_mesh`; those of families come from their cache."""
    if _is_member(shape_of, name):
        return MEMBER_STORE.mesh(*_family_and_number(name))
    return cast_mesh(shape_of(name).mesh)


def _is_member(shape_of: Callable[[str], UnitShape], name: str) -> bool:
    return shape_of is built_in_shape and name not in SHAPE_NAMES


@recent(100_000_000)
def _known(shape_of: Callable[[str], UnitShape], name: str) -> tuple[UnitShape, int]:
    if _is_member(shape_of, name):
        return MEMBER_STORE.outline(*_family_and_number(name))
    shape = shape_of(name)
    if name in SHAPE_NAMES:
        return shape, 0 if shape.surface else len(shape.mesh.faces)
    return outline_of(shape), len(shape.mesh.faces)


@lru_cache(maxsize=16)
def _built_in(source: str, names: tuple[str, ...], split: str) -> Objects:
    models: dict[str, Sequence[str]] = {name: (name,) for name in names}
    if source == "families":
        for name in names:
            members = (f"{name}/{i:04d}" for i in range(MEMBERS))
            models[name] = [m for m in members if split in ("all", object_split(m))]
    return Objects(models, built_in_shape, _no_digest)


def _no_digest(_name: str) -> str:
    return ""
