"""The models of a batch in one Mitsuba scene, each with a tree of its own, for shadow rays.

Camera rays need none (`rasteriser`). There are thousands of models, too many for one scene. Their
meshes are cached, and the scene of a batch refers to those that it shows, on a compact lattice.
Their structures are built for every batch: Mitsuba keeps them with the scene, and those of all
models would take more than 1 GiB.

A model's place on the lattice differs from batch to batch, but the bits of an image must not. So
rays start from the points of a grid that is fine compared with the precision needed, and coarse
enough that adding and subtracting a place of the lattice is exact in float32.
"""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from scenegen.objects.cast_meshes import overlapping
from scenegen.objects.solids import Mesh, UnitShape
from scenegen.rendering.meshes.unit_scene import triangle_mesh

Array = NDArray[Any]
ShapeOf = Callable[[str], UnitShape]
SPACING = 2.25  # distance between the models' origins; their bounding radius is 1
SIDE = 14  # of the lattice: coordinates stay below 16, where float32 resolves GRID
MOST_MODELS = SIDE**3
GRID = 2.0**-20
MOST_FACES_KEPT = 300_000  # of all cached models; a face takes about 300 bytes


class ModelCache:
    """Shape groups of the models used most recently, of all variants, up to MOST_FACES_KEPT."""

    def __init__(self) -> None:
        self.kept: OrderedDict[tuple[str, ShapeOf, str], tuple[Any, int]] = OrderedDict()
        self.faces = 0

    def clear(self) -> None:
        """Empty the cache."""
        self.kept.clear()
        self.faces = 0

    def get(self, variant: str, shape_of: ShapeOf, name: str, mesh: Mesh) -> Any:
        """Return a model's Mitsuba shape group from the cache, or make it."""
        key = (variant, shape_of, name)
        if key not in self.kept:
            grown = overlapping(mesh.vertices[mesh.faces])
            group = mi.load_dict({"type": "shapegroup", "mesh": triangle_mesh(name, grown)})
            self.kept[key] = group, len(grown)
            self.faces += len(grown)
            while self.faces > MOST_FACES_KEPT and len(self.kept) > 1:
                _, (_, faces) = self.kept.popitem(last=False)
                self.faces -= faces
        self.kept.move_to_end(key)
        return self.kept[key][0]


MODELS = ModelCache()


def model_scene(
    variant: str, shape_of: ShapeOf, names: Sequence[str], meshes: Sequence[Mesh]
) -> tuple[Any, Array]:
    """Build the scene of these models, at most MOST_MODELS; return it and their places, (M, 3)."""
    mi.set_variant(variant)
    _build_on_one_thread(variant)
    side = next(n for n in range(1, SIDE + 1) if n**3 >= len(names))
    cell = np.stack(np.unravel_index(np.arange(len(names)), (side, side, side)), axis=1)
    offset = (cell - (side - 1) / 2) * SPACING
    contents: dict[str, Any] = {"type": "scene"}
    for i, (name, mesh) in enumerate(zip(names, meshes, strict=True)):
        group = MODELS.get(variant, shape_of, name, mesh)
        contents[f"group{i}"] = group  # the scene must contain what instances refer to
        contents[f"model{i}"] = {
            "type": "instance",
            "shapegroup": group,
            "to_world": mi.ScalarTransform4f().translate(offset[i].tolist()),
        }
    return mi.load_dict(contents), offset if names else np.zeros((1, 3))


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
