"""The models of a batch in one Mitsuba scene: structures built once each, and placed anew.

Models come by the thousand, so there is no scene of them all. Each has a structure of its own,
kept while memory allows, and a batch's scene holds references to those of its models, on a compact
lattice. Where a model lies differs from batch to batch, and an image's bits must not: so rays start
from points of a grid so fine that it is below float32's own near the origin, and so coarse that
adding and subtracting a place of the lattice is exact.
"""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from scenegen.solids import UnitShape
from scenegen.unit_scene import UnitScene, mitsuba_shape, normal_table, stacked

Array = NDArray[Any]
SPACING = 2.25  # distance between the models' origins; their bounding radius is 1
SIDE = 14  # of the lattice: coordinates below 16, of which float32 holds every GRID-th
MOST_MODELS = SIDE**3
GRID = 2.0**-20
MOST_FACES_KEPT = 4_000_000  # of all structures together; about 200 bytes each


@dataclass(frozen=True, eq=False)
class _Model:
    """A model's structure, and its normals as in `normal_table`."""

    group: Any
    normals: Array


_kept: OrderedDict[tuple[str, UnitShape], _Model] = OrderedDict()


def model_scene(variant: str, shapes: Sequence[UnitShape]) -> UnitScene:
    """Build the scene of these models, at most MOST_MODELS, for a Mitsuba variant."""
    mi.set_variant(variant)
    models = [_model(variant, shape) for shape in shapes]
    side = next(n for n in range(1, SIDE + 1) if n**3 >= len(shapes))
    cell = np.stack(np.unravel_index(np.arange(len(shapes)), (side, side, side)), axis=1)
    offset = (cell - side // 2) * SPACING
    contents: dict[str, Any] = {"type": "scene"}
    for i, (model, place) in enumerate(zip(models, offset.tolist(), strict=True)):
        contents[f"group{i}"] = model.group  # the scene wants to know what is referred to
        contents[f"model{i}"] = {
            "type": "instance",
            "shapegroup": model.group,
            "to_world": mi.ScalarTransform4f().translate(place),
        }
    first_triangle, normals = stacked([model.normals for model in models])
    return UnitScene(mi.load_dict(contents), offset, first_triangle, GRID, normals)


def _model(variant: str, shape: UnitShape) -> _Model:
    key = (variant, shape)
    if key not in _kept:
        mesh = mitsuba_shape(shape, np.zeros(3))
        group = mi.load_dict({"type": "shapegroup", "mesh": mesh})
        _kept[key] = _Model(group, normal_table(shape))
        faces = sum(len(model.normals) for model in _kept.values())
        while faces > MOST_FACES_KEPT and len(_kept) > 1:
            _, dropped = _kept.popitem(last=False)
            faces -= len(dropped.normals)
    _kept.move_to_end(key)
    return _kept[key]
