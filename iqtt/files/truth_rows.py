"""What is known of questions, as rows of a question file."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from iqtt.files.layout import ID_BYTES, NO_CUBE
from iqtt.questions.specs import SplitSpec
from iqtt.render import Rendered
from iqtt.shapes.polycube import canonical, canonical_class, set_ids


def truth_rows(spec: SplitSpec, rendered: Sequence["Rendered"]) -> list[dict[str, Any]]:
    """Return the values of `truth_columns` for each of some questions."""
    most = spec.cubes[1]
    cubes = np.full((len(rendered), 4, most, 3), NO_CUBE, np.int8)
    shape_ids, class_ids = np.zeros((2, len(rendered), 4, ID_BYTES), np.uint8)
    counts = np.array([one.question.shapes.cubes.shape[1] for one in rendered])
    for count in np.unique(counts).tolist():
        rows = np.flatnonzero(counts == count)
        cubes[rows, :, :count] = [rendered[i].question.shapes.cubes for i in rows.tolist()]
        flat = cubes[rows, :, :count].reshape(-1, count, 3)
        for ids, form in ((shape_ids, canonical), (class_ids, canonical_class)):
            ids[rows] = set_ids(form(flat)).view(np.uint8).reshape(-1, 4, ID_BYTES)
    return [
        {
            "cube_count": counts[i],
            "cubes": cubes[i],
            "shape_id": shape_ids[i],
            "class_id": class_ids[i],
            "world_from_shape": one.question.world_from_shape,
            "light_count": one.question.light_count,
            "light_position": one.question.light_position,
            "light_color": one.question.light_color,
            "distractor_kind": one.question.shapes.kinds,
            "angle_degrees": one.question.angle_degrees,
            "visible_pixels": one.visible_pixels,
            "depth": one.depth,
        }
        for i, one in enumerate(rendered)
    ]
