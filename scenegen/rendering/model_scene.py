"""The models of a batch in one Mitsuba scene, each with a structure of its own.

Models come by the thousand, so there is no scene of them all. Their meshes are kept while memory
allows, and a batch's scene refers to those of its models, on a compact lattice. Where a model lies
differs from batch to batch, and an image's bits must not: so rays start from points of a grid so
fine that it is below float32's own near the origin, and so coarse that adding and subtracting a
place of the lattice is exact.
"""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from scenegen.objects.solids import UnitShape
from scenegen.rendering.unit_scene import SPHERE, UnitScene, mitsuba_shape, normal_table, stacked

Array = NDArray[Any]
ShapeOf = Callable[[str], UnitShape]
SPACING = 2.25  # distance between the models' origins; their bounding radius is 1
SIDE = 14  # of the lattice: coordinates below 16, of which float32 holds every GRID-th
MOST_MODELS = SIDE**3
GRID = 2.0**-20
MOST_FACES_KEPT = 8_000_000  # of all models together; about 100 bytes each


@dataclass(frozen=True, eq=False)
class _Model:
    """A model's mesh in a group, and its normals as in `normal_table`."""

    group: Any
    normals: Array


class _Models:
    """The models in use lately, of all variants, up to MOST_FACES_KEPT."""

    def __init__(self) -> None:
        self.kept: OrderedDict[tuple[str, ShapeOf, str], _Model] = OrderedDict()
        self.faces = 0

    def get(self, variant: str, shape_of: ShapeOf, name: str) -> _Model:
        """Return a model, made anew unless it is kept."""
        key = (variant, shape_of, name)
        if key not in self.kept:
            shape = shape_of(name)
            mesh = mitsuba_shape(shape, np.zeros(3))
            group = mi.load_dict({"type": "shapegroup", "mesh": mesh})
            self.kept[key] = _Model(group, normal_table(shape))
            self.faces += len(shape.triangles)
            while self.faces > MOST_FACES_KEPT and len(self.kept) > 1:
                _, oldest = self.kept.popitem(last=False)
                self.faces -= len(oldest.normals)
        self.kept.move_to_end(key)
        return self.kept[key]


_models = _Models()


def forget_models() -> None:
    """Let go of all models that are kept."""
    _models.kept.clear()
    _models.faces = 0


def model_scene(variant: str, shape_of: ShapeOf, names: Sequence[str]) -> UnitScene:
    """Build the scene of these models, at most MOST_MODELS, for a Mitsuba variant."""
    mi.set_variant(variant)
    models = [_models.get(variant, shape_of, name) for name in names]
    side = next(n for n in range(1, SIDE + 1) if n**3 >= len(names))
    cell = np.stack(np.unravel_index(np.arange(len(names)), (side, side, side)), axis=1)
    offset = (cell - (side - 1) / 2) * SPACING
    contents: dict[str, Any] = {"type": "scene"}
    for i, (model, place) in enumerate(zip(models, offset.tolist(), strict=True)):
        contents[f"group{i}"] = model.group  # the scene wants to know what is referred to
        contents[f"model{i}"] = {
            "type": "instance",
            "shapegroup": model.group,
            "to_world": mi.ScalarTransform4f().translate(place),
        }
    first_triangle, normals = stacked([model.normals for model in models])
    if not names:  # of images without objects, whose unused slots refer to the first model
        offset, first_triangle = np.zeros((1, 3)), np.full(1, SPHERE, np.uint32)
    return UnitScene(mi.load_dict(contents), offset, first_triangle, GRID, normals)
