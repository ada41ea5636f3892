"""Write a scene as a Wavefront OBJ file and the library of its materials.

Each plane of the room and each object is an `o` of its own, with the normals of its smooth surface.
"""

import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.description.scenes import SceneSpec
from scenegen.objects.scene_mesh import scene_parts
from scenegen.objects.solids import UnitShape


def write_obj(
    scene: SceneSpec,
    path: str | Path,
    materials: str,
    shape_of: Callable[[str], UnitShape],
) -> None:
    """Write room and objects as triangles in the world frame; `materials` names their library."""
    unit = "scene unit" if scene.interior is None else "metre"
    lines = [
        f"# scene {scene.index}: world frame, y up, {unit}s",
        f"mtllib {one_word(materials)}",
    ]
    vertices = normals = 0  # before this part; OBJ counts from 1
    for part in scene_parts(scene, shape_of):
        unique, number = np.unique(
            part.normals.reshape(-1, 3).round(8), axis=0, return_inverse=True
        )
        corners = np.stack([part.mesh.faces.reshape(-1) + vertices, number.reshape(-1) + normals])
        lines += [f"o {one_word(part.name)}", f"usemtl {_material(part.object_id)}"]
        lines += _lines("v %.8f %.8f %.8f", part.mesh.vertices)
        lines += _lines("vn %.8f %.8f %.8f", unique + 0.0)  # + 0.0: no minus before a zero
        lines += _lines("f %d//%d %d//%d %d//%d", corners.T.reshape(-1, 6) + 1)
        vertices += len(part.mesh.vertices)
        normals += len(unique)
    Path(path).write_text("\n".join([*lines, ""]))


def write_mtl(scene: SceneSpec, path: str | Path) -> None:
    """Write the library: Kd and Ka are rho, Ks and Ns are k_s and exponent of Phong's lobe."""
    lines = ["# linear reflectance, as in the shading equation"]
    found = [(item.reflectance, item.specular, item.shininess) for item in scene.objects]
    for k, (rho, specular, shininess) in enumerate([(scene.room_reflectance, 0.0, 1.0), *found]):
        if rho is not None:
            color = " ".join(map(str, rho))
            lines += [f"newmtl {_material(k)}", f"Ka {color}", f"Kd {color}"]
            lines += [f"Ks {specular} {specular} {specular}", f"Ns {shininess}"]
            lines += [f"illum {2 if specular else 1}"]
    Path(path).write_text("\n".join([*lines, ""]))


def _material(object_id: int) -> str:
    return f"object_{object_id}" if object_id else "room"


def one_word(name: str) -> str:
    """Return a name without blanks and control characters, which would end it."""
    return re.sub(r"[^\w./+-]+", "_", name)


def _lines(form: str, rows: NDArray[Any]) -> Iterable[str]:
    return (form % tuple(row) for row in rows.tolist())
