"""The models of a batch in one Mitsuba scene, each with an acceleration structure of its own.

There are thousands of models, too many for one scene. Their meshes are cached, and the scene of a
batch refers to those that it shows, on a compact lattice. Their structures are built for every
batch: Mitsuba keeps them with the scene, and those of all models would take more than 1 GiB.

A model's place on the lattice differs from batch to batch, but the bits of an image must not. So
rays start from the points of a grid that is fine compared with the precision needed, and coarse
enough that adding and subtracting a place of the lattice is exact in float32.
"""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from scenegen.objects.catalogue import mesh_to_cast
from scenegen.objects.solids import UnitShape
from scenegen.rendering.unit_scene import NO_TRIANGLE, UnitScene, stacked, triangle_mesh

Array = NDArray[Any]
ShapeOf = Callable[[str], UnitShape]
SPACING = 2.25  # distance between the models' origins; their bounding radius is 1
SIDE = 14  # of the lattice: coordinates stay below 16, where float32 resolves GRID
MOST_MODELS = SIDE**3
GRID = 2.0**-20
MOST_FACES_KEPT = 300_000  # of all cached models; a face takes about 300 bytes


@dataclass(frozen=True, eq=False)
class _Model:
    """A model's mesh in a Mitsuba shape group, and its normals as from `normal_table`."""

    group: Any
    normals: Array


class ModelCache:
    """A cache of the models used most recently, of all variants, up to MOST_FACES_KEPT."""

    def __init__(self) -> None:
        self.kept: OrderedDict[tuple[str, ShapeOf, str], _Model] = OrderedDict()
        self.faces = 0

    def clear(self) -> None:
        """Empty the cache."""
        self.kept.clear()
        self.faces = 0

    def get(self, variant: str, shape_of: ShapeOf, name: str) -> _Model:
        """Return a model from the cache, or make it."""
        key = (variant, shape_of, name)
        if key not in self.kept:
            mesh = mesh_to_cast(shape_of, name)
            group = mi.load_dict(
                {"type": "shapegroup", "mesh": triangle_mesh(name, mesh.triangles)}
            )
            self.kept[key] = _Model(group, mesh.normals)
            self.faces += len(mesh.normals)
            while self.faces > MOST_FACES_KEPT and len(self.kept) > 1:
                _, oldest = self.kept.popitem(last=False)
                self.faces -= len(oldest.normals)
        self.kept.move_to_end(key)
        return self.kept[key]


MODELS = ModelCache()


def model_scene(variant: str, shape_of: ShapeOf, names: Sequence[str]) -> UnitScene:
    """Build the scene of these models, at most MOST_MODELS, for a Mitsuba variant."""
    mi.set_variant(variant)
    _build_on_one_thread(variant)
    models = [MODELS.get(variant, shape_of, name) for name in names]
    side = next(n for n in range(1, SIDE + 1) if n**3 >= len(names))
    cell = np.stack(np.unravel_index(np.arange(len(names)), (side, side, side)), axis=1)
    offset = (cell - (side - 1) / 2) * SPACING
    contents: dict[str, Any] = {"type": "scene"}
    for i, (model, place) in enumerate(zip(models, offset.tolist(), strict=True)):
        contents[f"group{i}"] = model.group  # the scene must contain what instances refer to
        contents[f"model{i}"] = {
            "type": "instance",
            "shapegroup": model.group,
            "to_world": mi.ScalarTransform4f().translate(place),
        }
    first_triangle, normals = stacked([model.normals for model in models])
    if not names:  # images without objects: their unused slots refer to a first model
        offset, first_triangle = np.zeros((1, 3)), np.full(1, NO_TRIANGLE, np.uint32)
    return UnitScene(mi.load_dict(contents), offset, first_triangle, GRID, normals)


@lru_cache
def _build_on_one_thread(variant: str) -> None:
    """Let Embree build its structures on the thread that asks for them.

    It takes the number of threads from Dr.Jit's pool when the process builds its first scene. Our
    models are small: sharing the work on one of 2,000 faces costs as much as the work.
    """
    if variant.startswith("llvm"):
        dr.sync_thread()
        threads = dr.thread_count()
        dr.set_thread_count(1)
        mi.load_dict({"type": "scene"})
        dr.set_thread_count(threads)
