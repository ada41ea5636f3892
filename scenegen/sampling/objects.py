"""Which objects a scene shows: how many, their classes, models and materials."""

from dataclasses import dataclass

from scenegen.camera import Vector3
from scenegen.common.errors import SpecError
from scenegen.common.seeding import Purpose, item_rng
from scenegen.description.specs import DatasetSpec
from scenegen.objects.catalogue import Objects, outline
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.solids import UnitShape

MAX_MODELS = 100  # models of a class drawn for one object before the class is given up


@dataclass(frozen=True, eq=False)
class Unplaced:
    """An object before it has a size, an orientation and a place.

    `shape` has no triangles, only what placement needs; `mesh` is the digest of its file.
    """

    shape: UnitShape
    mesh: str
    reflectance: Vector3
    specular: float
    shininess: float


def sample_objects(spec: DatasetSpec, index: int, objects: Objects) -> list[Unplaced]:
    """Draw the objects of item `index`; for a model that cannot be used another one is drawn."""
    rng = item_rng(spec.seed, index, Purpose.OBJECTS)
    count = int(rng.integers(spec.objects[0], spec.objects[1] + 1))
    names = [spec.shapes[i] for i in rng.integers(len(spec.shapes), size=count)]
    rng = item_rng(spec.seed, index, Purpose.MATERIALS)
    colors = rng.uniform(0.15, 0.95, (count, 3)) if spec.random_reflectance else None
    specular, shininess = (rng.uniform(*r, count).tolist() for r in (spec.specular, spec.shininess))
    drawn = []
    for k, name in enumerate(names):
        shape, mesh = _sample_model(spec, index, k, name, objects)
        red, green, blue = spec.reflectance if colors is None else colors[k].tolist()
        drawn.append(Unplaced(shape, mesh, (red, green, blue), specular[k], shininess[k]))
    return drawn


def _sample_model(
    spec: DatasetSpec, index: int, k: int, name: str, objects: Objects
) -> tuple[UnitShape, str]:
    """Draw a usable model of a class for object k; return its outline and file's digest."""
    models = objects.models[name]
    if spec.source == "shapes":
        return outline(objects.shape, models[0]), objects.digest(models[0])
    rng = item_rng(spec.seed, index, Purpose.MODELS, k)
    for _ in range(MAX_MODELS):
        model = models[int(rng.integers(len(models)))]
        try:
            return outline(objects.shape, model), objects.digest(model)
        except BadMeshError as error:
            reason = str(error)
    raise SpecError(
        f"classes: {MAX_MODELS} models drawn from {name!r} cannot be used, the last one since"
        f" {reason}",
        hint="`scenegen check-objects` tells of all",
    )
