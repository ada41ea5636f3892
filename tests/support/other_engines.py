"""Other ways to render the same scenes: Embree on one mesh, and another process."""

import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.ndimage import grey_dilation, grey_erosion
from trimesh.ray.ray_pyembree import RayMeshIntersector

from scenegen.camera import pixel_directions
from scenegen.description.scenes import SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.objects.basic_shapes import unit_shape
from scenegen.objects.scene_mesh import scene_parts
from scenegen.objects.solids import UnitShape
from scenegen.rendering import renderer
from scenegen.rendering.ground_truth import GroundTruth

Array = NDArray[Any]


def bits(truth: GroundTruth, row: int) -> tuple[bytes, ...]:
    """Return the bytes of all fields of one image."""
    return tuple(getattr(truth, name)[row].tobytes() for name in truth.pixels())


def near_silhouettes(object_id: Array) -> Array:
    """Return a mask of the pixels within one pixel, corners included, of another object id."""
    return np.stack([grey_dilation(ids, 3) != grey_erosion(ids, 3) for ids in object_id])


def cast_whole_scene(
    scene: SceneSpec, spec: DatasetSpec, shape_of: Callable[[str], UnitShape] = unit_shape
) -> tuple[Array, Array, Array]:
    """Depth, object id and camera-frame face normal by one other ray caster on one mesh."""
    camera, size = scene.cameras[0], (spec.height, spec.width)
    matrix = camera.world_from_camera
    rays = pixel_directions(*size, camera.fov_y_degrees).reshape(-1, 3) @ matrix[:3, :3].T
    mesh = trimesh.util.concatenate([part.mesh for part in scene_parts(scene, shape_of)])
    points, hit, faces = RayMeshIntersector(mesh).intersects_location(
        np.broadcast_to(matrix[:3, 3], rays.shape), rays, multiple_hits=False
    )
    depth, object_id = np.full(len(rays), np.nan), np.full(len(rays), -1)
    normal = np.zeros_like(rays)
    counts = [6, *(len(shape_of(item.shape).triangles) for item in scene.objects)]
    depth[hit] = (matrix[:3, 3] - points) @ matrix[:3, 2]
    object_id[hit] = np.repeat(np.arange(len(counts)), counts)[faces]
    normal[hit] = mesh.face_normals[faces] @ matrix[:3, :3]
    return depth.reshape(size), object_id.reshape(size), normal.reshape(*size, 3)


RENDER = """
import pickle, sys
from scenegen.rendering import renderer
from scenegen.rendering.packing import pack
renderer.select_variant = lambda device: "scalar_rgb"
spec, scenes = pickle.load(sys.stdin.buffer)
truth = renderer.render(pack(spec, scenes))
import mitsuba
assert mitsuba.variant() == "scalar_rgb"
assert "scenegen.rendering.drjit_renderer" not in sys.modules
pickle.dump(truth, sys.stdout.buffer)
"""


def render_by_the_fallback(spec: DatasetSpec, scenes: list[SceneSpec]) -> GroundTruth:
    """Render in a process of its own, where no vectorised variant is ever loaded."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", RENDER],
        input=pickle.dumps((spec, scenes)),
        capture_output=True,
        check=False,
        cwd=Path(renderer.__file__).parents[2],
        timeout=120,
    )
    assert done.returncode == 0, done.stderr.decode()
    truth: GroundTruth = pickle.loads(done.stdout)
    return truth
