"""(a): one `mi.load_dict` and one `mi.render` per scene, as a user would do without scenegen.

What a user can prepare once is prepared outside the clock: unit meshes, integrator, material, and
a first pass over the same scenes, which compiles the kernels. No file is written, no object ids are
made, there is no ambient light, and a jittered sample is no exact ground truth: all of that favours
this side. Objects are loaded in three ways, of which the fastest counts:

files: a PLY file for each shape, loaded with `to_world` (Mitsuba's usual way);
merged: room and meshes moved with numpy and put into a single mesh;
instances: prebuilt `shapegroup`s and an `instance` for each object.

Exact spheres are Mitsuba's own in all of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from benchmarks.jobs.inputs import Mesh, join, moved, read_depth, read_scenes, unit_meshes
from benchmarks.jobs.timing import repeat
from iqtt.questions.specs import SplitSpec
from scenegen.camera import Camera, pixel_directions
from scenegen.description.scenes import SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.objects.scene_mesh import room_mesh, world_from_object
from scenegen.objects.sources import file_objects
from scenegen.rendering.backend import select_variant

Array = NDArray[Any]
WAYS = ("files", "merged", "instances")
DEPTH = 3  # channel of the distance, behind the colour
NEAR = 0.01  # Mitsuba counts distances from its near plane; this is its default
DIRECT = {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0}


@dataclass(frozen=True, eq=False)
class Kit:
    """What is prepared once; `objects` holds a PLY path, `Mesh` or shapegroup for each shape."""

    spec: DatasetSpec
    way: str
    objects: dict[str, Any]
    room: Mesh
    material: Any
    integrator: Any


def per_scene(
    rooms: str,
    count: int,
    repeats: int,
    variant: str,
    coarse: bool,
    folder: str,
    root: str = "",
    ways: Sequence[str] = WAYS,
) -> dict[str, Any]:
    """Time load, render and conversion to numpy of every scene, in the fastest way.

    Instances come last: Mitsuba slows down with the number of shapes that are alive, used or not.
    """
    choose(variant)
    spec, scenes = read_scenes(rooms, count)
    names = {item.shape: None for scene in scenes for item in scene.objects}
    meshes = unit_meshes(names, coarse, file_objects(spec, objects_root=root or None).shape)
    seconds = {}
    for way in ways:
        kit = prepare(spec, way, meshes, f"{folder}/{variant}-{coarse}")
        check(render_scene(kit, scenes[0], 0), scenes[0].cameras[0], read_depth(rooms, 1)[0])
        seconds[way] = repeat(partial(render_all, kit, scenes), repeats)
    fastest = min(ways, key=lambda way: min(seconds[way]))
    rates = ", ".join(f"{way} {count / min(seconds[way]):.0f}" for way in ways)
    return {"seconds": seconds[fastest], "images": count, "note": f"of {rates}"}


def choose(variant: str) -> None:
    """Set Mitsuba's variant. Raises where it needs LLVM and there is no good one."""
    if variant != "scalar_rgb":
        select_variant("cpu")
    mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Error)


def render_all(kit: Kit, scenes: list[SceneSpec]) -> None:
    """Load and render every scene, which is what is timed."""
    for number, scene in enumerate(scenes):
        render_scene(kit, scene, number)


def render_scene(kit: Kit, scene: SceneSpec, number: int) -> Array:
    """Return colour, distance and normal, (H, W, 7)."""
    loaded = mi.load_dict(describe(kit, scene))
    return np.array(mi.render(loaded, spp=1, seed=number))


def prepare(spec: DatasetSpec, way: str, meshes: dict[str, Mesh], stem: str) -> Kit:
    """Make what all scenes share."""
    material = diffuse(spec.reflectance)
    objects: dict[str, Any] = {}
    for name, mesh in meshes.items():
        if way == "files":
            objects[name] = f"{stem}-{name.replace('/', '-')}.ply"
            mitsuba_mesh(name, mesh).write_ply(objects[name])
        elif way == "instances":
            inside = mitsuba_mesh(name, mesh, material)
            objects[name] = mi.load_dict({"type": "shapegroup", "mesh": inside})
        else:
            objects[name] = mesh
    shell = room_mesh()
    room = Mesh(np.array(shell.vertices), np.array(shell.vertex_normals), np.array(shell.faces))
    aov = {"type": "aov", "aovs": "distance:depth,normal:sh_normal", "colour": DIRECT}
    return Kit(spec, way, objects, room, material, mi.load_dict(aov))


def describe(kit: Kit, scene: SceneSpec) -> dict[str, Any]:
    """Return the scene as `mi.load_dict` wants it."""
    contents = {"type": "scene", "integrator": kit.integrator}
    contents["sensor"] = sensor(kit.spec, scene.cameras[0])
    for j, light in enumerate(scene.lights):
        contents[f"light{j}"] = point_light(light.position, light.color)
    merged = [kit.room]
    for k, item in enumerate(scene.objects):
        matrix = world_from_object(item.position, item.rotation, item.scale)
        to_world = mi.ScalarTransform4f(matrix.astype(np.float32))
        shape = kit.objects.get(item.shape)
        if shape is None:
            entry = {"type": "sphere", "to_world": to_world, "bsdf": kit.material}
        elif kit.way == "files":
            entry = {"type": "ply", "filename": shape, "to_world": to_world, "bsdf": kit.material}
        elif kit.way == "instances":
            contents[f"group-{item.shape.replace('/', '-')}"] = shape
            entry = {"type": "instance", "group": shape, "to_world": to_world}
        else:
            merged.append(moved(shape, matrix))
            continue
        contents[f"object{k}"] = entry
    if kit.way == "merged":
        contents["meshes"] = mitsuba_mesh("meshes", join(merged), kit.material)
    else:
        for axis, to_world in enumerate(room_planes()):
            plane = {"type": "rectangle", "to_world": to_world, "bsdf": kit.material}
            contents[f"plane{axis}"] = plane
    return contents


def point_light(position: Sequence[float], color: Sequence[float]) -> dict[str, Any]:
    """Return a point light of some radiant intensity."""
    power = {"type": "rgb", "value": list(color)}
    return {"type": "point", "position": list(position), "intensity": power}


def diffuse(reflectance: Sequence[float]) -> Any:
    """Return a matte material."""
    return mi.load_dict(
        {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(reflectance)}}
    )


def sensor(spec: DatasetSpec | SplitSpec, camera: Camera) -> dict[str, Any]:
    """Return camera, film and sampler: one sample a pixel, box filter."""
    view = mi.ScalarTransform4f().look_at(
        origin=list(camera.position), target=list(camera.target), up=[0, 1, 0]
    )
    film = {"type": "hdrfilm", "width": spec.width, "height": spec.height}
    film |= {"pixel_format": "rgb", "component_format": "float32", "rfilter": {"type": "box"}}
    lens = {"fov": camera.fov_y_degrees, "fov_axis": "y", "near_clip": NEAR, "to_world": view}
    sampler = {"type": "independent", "sample_count": 1}
    return {"type": "perspective", **lens, "film": film, "sampler": sampler}


def room_planes() -> list[Any]:
    """Return what takes Mitsuba's rectangle, [-1, 1]^2 facing +z, to z = 0, x = 0 and y = 0."""
    unit = mi.ScalarTransform4f().translate([0.5, 0.5, 0]).scale([0.5, 0.5, 1])
    unit_axes = np.eye(4, dtype=np.float32)
    turns = [unit_axes, unit_axes[[2, 0, 1, 3]], unit_axes[[1, 2, 0, 3]]]
    return [mi.ScalarTransform4f(turn) @ unit for turn in turns]


def mitsuba_mesh(name: str, mesh: Mesh, material: Any = None) -> Any:
    """Return a mesh as Mitsuba's."""
    properties = mi.Properties()
    if material is not None:
        properties["bsdf"] = material
    made = mi.Mesh(name, len(mesh.points), len(mesh.faces), properties, has_vertex_normals=True)
    parameters = mi.traverse(made)
    parameters["vertex_positions"] = mesh.points.astype(np.float32).ravel()
    parameters["vertex_normals"] = mesh.normals.astype(np.float32).ravel()
    parameters["faces"] = mesh.faces.astype(np.uint32).ravel()
    parameters.update()
    return made


def check(image: Array, camera: Camera, depth: Array) -> None:
    """Raise AssertionError unless the image shows the scene whose depth map is given."""
    directions = pixel_directions(depth.shape[0], depth.shape[1], camera.fov_y_degrees)
    planar = image[..., DEPTH] / np.linalg.norm(directions, axis=-1) + NEAR
    error = float(np.median(np.abs(planar - depth)))
    if error > 0.005:  # the jitter of the sample within its pixel stays far below
        raise AssertionError(f"Mitsuba rendered another scene: depths are off by {error:.3f}")
