"""One `mi.load_dict` and one `mi.render` for each scene, as a user would do without scenegen.

What a user can prepare once is prepared outside the clock: unit meshes, integrator, material, and
a first pass over the same scenes, which compiles the kernels. No file is written, no object ids are
made, there is no ambient light, and a jittered sample is no exact ground truth: all of that favours
this side. The objects of rooms are loaded in two ways, of which the faster counts:

merged: room and meshes are moved with numpy and put into a single mesh;
instances: there is a `shapegroup` for each shape, and an `instance` for each object.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from trimesh.grouping import unique_rows

from benchmarks.timing import measured
from iqtt.questions.distractors import make_pools
from iqtt.questions.packing import Question, cube_centres
from iqtt.questions.specs import SplitSpec
from iqtt.render import render_questions
from scenegen.camera import Camera, pixel_directions
from scenegen.description.scenes import SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.objects.basic_shapes import unit_shape
from scenegen.objects.scene_mesh import room_mesh, welded, world_from_object
from scenegen.objects.solids import UnitShape
from scenegen.objects.sources import file_objects
from scenegen.rendering.backend import select_variant
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
Mesh = tuple[Array, Array, Array]  # corners (V, 3), their normals (V, 3), triangles (F, 3)
WAYS = ("merged", "instances")
DEPTH = 3  # channel of the distance, behind the colour
NEAR = 0.01  # Mitsuba counts distances from its near plane; this is its default
DIRECT = {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0}


def rooms(path: str, count: int, repeats: int, variant: str, **roots: str) -> dict[str, Any]:
    """Time load, render and conversion to numpy of the first scenes of a file.

    `roots` are those of `file_objects`. Raises AssertionError where the depths are not those of the
    file.
    """
    _choose(variant)
    with RoomsFile(path) as file:
        spec, scenes = file.spec, [file.scene(row) for row in range(count)]
        depth = np.asarray(file.read("depth", 0))
    names = {item.shape for scene in scenes for item in scene.objects}
    objects = file_objects(spec, **roots)
    meshes = {name: _mesh(objects.shape(name)) for name in names}
    integrator = {"type": "aov", "aovs": "distance:depth,normal:sh_normal", "colour": DIRECT}
    records = {}
    for way in WAYS:  # instances last: Mitsuba slows down with the number of shapes that are alive
        describe = _describer(spec, way, meshes)
        loaded = mi.load_dict(integrator)
        _check(_render(loaded, describe(scenes[0]), 0), scenes[0].cameras[0], depth)
        records[way] = measured(partial(_render_all, loaded, describe, scenes), repeats)
    best = min(WAYS, key=lambda way: min(records[way]["seconds"]))
    return {**records[best], "images": count, "note": best}


def questions(count: int, repeats: int, variant: str) -> dict[str, Any]:
    """Time load, render and conversion to numpy of each image of some questions, colour only.

    The cubes of a shape enter as one mesh, made outside the clock, in the camera's frame.
    """
    spec = SplitSpec()
    batches = render_questions(make_pools(spec), "train", 0, count)
    made = [item.question for batch in batches for item in batch]
    _choose(variant)
    images = [_cubes(spec, question, i) for question in made for i in range(4)]
    record = measured(partial(_render_all, mi.load_dict(DIRECT), dict, images), repeats)
    return {**record, "images": len(images)}


def _choose(variant: str) -> None:
    if variant != "scalar_rgb":
        select_variant("cpu")
    mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Error)


def _render_all(integrator: Any, describe: Callable[[Any], Any], items: Sequence[Any]) -> None:
    for number, item in enumerate(items):
        _render(integrator, describe(item), number)


def _render(integrator: Any, contents: dict[str, Any], number: int) -> Array:
    scene = mi.load_dict({"type": "scene", "integrator": integrator, **contents})
    return np.array(mi.render(scene, spp=1, seed=number))


def _describer(
    spec: DatasetSpec, way: str, meshes: dict[str, Mesh]
) -> Callable[[SceneSpec], dict[str, Any]]:
    """Return a function from a scene to its contents as `mi.load_dict` wants them."""
    material = _diffuse(spec.reflectance)
    shell = room_mesh()
    room = (np.array(shell.vertices), np.array(shell.vertex_normals), np.array(shell.faces))
    known: dict[str, Any] = {}
    if way == "instances":
        known = {
            name: mi.load_dict({"type": "shapegroup", "mesh": loaded(mesh, material)})
            for name, mesh in meshes.items()
        }
        known["room"] = loaded(room, material)

    def describe(scene: SceneSpec) -> dict[str, Any]:
        contents = {"sensor": _sensor(spec, scene.cameras[0])}
        for j, light in enumerate(scene.lights):
            contents[f"light{j}"] = _point_light(light.position, light.color)
        merged = [room]
        for k, item in enumerate(scene.objects):
            matrix = world_from_object(item.position, item.rotation, item.scale)
            if way == "merged":
                merged.append(_moved(meshes[item.shape], matrix))
                continue
            group = contents[f"group-{item.shape.replace('/', '-')}"] = known[item.shape]
            to_world = mi.ScalarTransform4f(matrix.astype(np.float32))
            contents[f"object{k}"] = {"type": "instance", "group": group, "to_world": to_world}
        contents["room"] = loaded(_joined(merged), material) if way == "merged" else known["room"]
        return contents

    return describe


def _cubes(spec: SplitSpec, question: Question, i: int) -> dict[str, Any]:
    """Return mesh, lights and camera of one image of a question."""
    cubes, box = question.shapes.cubes[i], welded(unit_shape("box"))
    corners = np.asarray(box.vertices) * np.sqrt(3) / 2
    centres = cube_centres([cubes], len(cubes))[0]
    points = (centres[:, None] + corners).reshape(-1, 3) @ question.world_from_shape[i].T
    faces = np.concatenate([np.asarray(box.faces) + k * len(corners) for k in range(len(cubes))])
    contents = {"mesh": loaded((points, np.zeros_like(points), faces), _diffuse(spec.reflectance))}
    contents["sensor"] = _sensor(spec, spec.camera(question.camera_distance))
    for j in range(int(question.light_count[i])):
        position, color = question.light_position[i, j], question.light_color[i, j]
        contents[f"light{j}"] = _point_light(position.tolist(), color.tolist())
    return contents


def _point_light(position: Sequence[float], color: Sequence[float]) -> dict[str, Any]:
    power = {"type": "rgb", "value": list(color)}
    return {"type": "point", "position": list(position), "intensity": power}


def _diffuse(reflectance: Sequence[float]) -> Any:
    color = {"type": "rgb", "value": list(reflectance)}
    return mi.load_dict({"type": "diffuse", "reflectance": color})


def _sensor(spec: DatasetSpec | SplitSpec, camera: Camera) -> dict[str, Any]:
    """Return camera, film and sampler: one sample a pixel, box filter."""
    view = mi.ScalarTransform4f().look_at(
        origin=list(camera.position), target=list(camera.target), up=[0, 1, 0]
    )
    film = {"type": "hdrfilm", "width": spec.width, "height": spec.height}
    film |= {"pixel_format": "rgb", "component_format": "float32", "rfilter": {"type": "box"}}
    lens = {"fov": camera.fov_y_degrees, "fov_axis": "y", "near_clip": NEAR, "to_world": view}
    sampler = {"type": "independent", "sample_count": 1}
    return {"type": "perspective", **lens, "film": film, "sampler": sampler}


def _mesh(shape: UnitShape) -> Mesh:
    """Return a unit shape with corners that triangles share."""
    points, normals = shape.triangles.reshape(-1, 3), shape.normals.reshape(-1, 3)
    first, number = unique_rows(np.concatenate([points, normals], axis=1), digits=6)
    return points[first], normals[first], number.reshape(-1, 3)


def _moved(mesh: Mesh, world_from_object: Array) -> Mesh:
    """Apply a similarity (4, 4); normals keep their directions only."""
    points, normals, faces = mesh
    linear = world_from_object[:3, :3].T
    return points @ linear + world_from_object[:3, 3], normals @ linear, faces


def _joined(meshes: list[Mesh]) -> Mesh:
    points, normals, faces = zip(*meshes, strict=True)
    starts = np.cumsum([0, *map(len, points)])
    moved = [part + start for part, start in zip(faces, starts[:-1], strict=True)]
    return np.concatenate(points), np.concatenate(normals), np.concatenate(moved)


def loaded(mesh: Mesh, material: Any) -> Any:
    """Return a mesh as Mitsuba's."""
    points, normals, faces = mesh
    properties = mi.Properties()
    properties["bsdf"] = material
    loaded = mi.Mesh("mesh", len(points), len(faces), properties, has_vertex_normals=True)
    parameters = mi.traverse(loaded)
    parameters["vertex_positions"] = points.astype(np.float32).ravel()
    parameters["vertex_normals"] = normals.astype(np.float32).ravel()
    parameters["faces"] = faces.astype(np.uint32).ravel()
    parameters.update()
    return loaded


def _check(image: Array, camera: Camera, depth: Array) -> None:
    """Raise AssertionError unless the image shows the scene whose depth map is given."""
    directions = pixel_directions(depth.shape[0], depth.shape[1], camera.fov_y_degrees)
    planar = image[..., DEPTH] / np.linalg.norm(directions, axis=-1) + NEAR
    error = float(np.median(np.abs(planar - depth)))
    if error > 0.005:  # the jitter of the sample within its pixel stays far below
        raise AssertionError(f"Mitsuba rendered another scene: depths are off by {error:.3f}")
