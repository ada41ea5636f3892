"""DatasetSpec -> SceneSpec: all randomness ends here.

Camera, lights, and number and kinds of the objects are drawn once for an item, so that refusals
cannot bend their distributions. What a refusal draws again is the objects' sizes, orientations and
places (`attempt`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenegen.camera import Camera, Vector3
from scenegen.common.errors import PlacementError, SpecError
from scenegen.common.rotations import rotation_matrix
from scenegen.common.seeding import Purpose, item_rng
from scenegen.description.scenes import Light, PlacedObject, SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.objects.catalogue import Objects, objects_of, outline
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.solids import UnitShape
from scenegen.sampling.placement import Body, find_place, frustum_normals, random_rotation

MAX_ATTEMPTS = 100  # scenes proposed for one item before the request is called impossible
MAX_MODELS = 100  # of a class drawn for one object before all of them are given up
POSES_PER_OBJECT = 8  # sizes and orientations tried for one object of a proposal


def sample_scene(
    spec: DatasetSpec, index: int, attempt: int = 0, objects: Objects | None = None
) -> SceneSpec | None:
    """Propose the scene of item `index`; None where this attempt could not place its objects.

    Pure: the same arguments give the same scene, on any machine, in any order. The caller renders
    a proposal, and asks for the next attempt if some object is not visible enough.

    Args:
        objects: None for `objects_of(spec)`.

    Raises SpecError where no model of a class can be used.
    """
    cameras = sample_cameras(spec, index)
    kinds = _sample_kinds(spec, index, objects or objects_of(spec))
    placed = _place_objects(spec, index, attempt, cameras, kinds)
    if len(placed) < len(kinds):
        return None
    return SceneSpec(
        index=index,
        cameras=cameras,
        objects=tuple(item for item, _ in placed),
        lights=sample_lights(spec, index),
        ambient=spec.ambient,
        attenuation=spec.attenuation,
        room_reflectance=spec.room_reflectance,
    )


def refusal(
    spec: DatasetSpec, index: int, placed_but_hidden: int, objects: Objects | None = None
) -> PlacementError:
    """Say why item `index` got no scene, `placed_but_hidden` of its proposals being rendered."""
    kinds = _sample_kinds(spec, index, objects or objects_of(spec))
    wanted = len(kinds)
    if placed_but_hidden:
        return PlacementError(
            f"item {index}: {MAX_ATTEMPTS} proposals with {wanted} objects, {placed_but_hidden} of"
            f" which were rendered, all with an object showing fewer than"
            f" {spec.min_visible_pixels} pixels; try fewer --objects, a larger --object-radius or"
            f" fewer --min-visible-pixels"
        )
    cameras = sample_cameras(spec, index)
    best = max(len(_place_objects(spec, index, k, cameras, kinds)) for k in range(10))
    return PlacementError(
        f"item {index}: at most {best} of its {wanted} objects found room in {MAX_ATTEMPTS}"
        f" proposals (inside the room and the image, touching nothing); try fewer --objects, a"
        f" smaller --object-radius or --allow-cropped"
    )


def octant_direction(rng: np.random.Generator) -> Vector3:
    """Draw a unit direction uniform by area on the positive octant of the sphere.

    By Archimedes' hat-box theorem its height is uniform.
    """
    height, turn = rng.random(2)
    return _octant_point(float(height), float(turn) * math.pi / 2)


def _octant_point(height: float, azimuth: float) -> Vector3:
    radius = math.sqrt(1.0 - height * height)
    return (radius * math.cos(azimuth), height, radius * math.sin(azimuth))


def sample_cameras(spec: DatasetSpec, index: int) -> tuple[Camera, ...]:
    """Draw the input view, and turn it about the vertical axis through the target for the others.

    With one view it is uniform by area on the positive octant. Several stay in the octant, where
    no wall is between: the input view lies so near one side of it, drawn for each scene, that the
    widest turn towards the other side fits; its height and its azimuth within that are uniform.
    """
    rng = item_rng(spec.seed, index, Purpose.CAMERA)
    height, turn = (float(x) for x in rng.random(2))
    widest = math.radians(spec.views[-1])
    first = turn * (math.pi / 2 - widest)
    mirrored = widest > 0 and bool(rng.random() < 0.5)
    cameras = []
    for degrees in spec.views:
        azimuth = first + math.radians(degrees)
        direction = _octant_point(height, math.pi / 2 - azimuth if mirrored else azimuth)
        position = _around(spec.camera_target, spec.camera_radius, direction)
        cameras.append(Camera(position, spec.camera_target, spec.fov_y_degrees))
    return tuple(cameras)


def sample_lights(spec: DatasetSpec, index: int) -> tuple[Light, ...]:
    """Lights share the level equally; each colour has a random hue and its largest channel 1."""
    rng = item_rng(spec.seed, index, Purpose.LIGHTS)
    count = int(rng.integers(spec.lights[0], spec.lights[1] + 1))
    distance = spec.light_radius
    falloff = spec.attenuation[0] * distance + spec.attenuation[1] * distance**2
    lights = []
    for _ in range(count):
        position = _around(spec.camera_target, distance, octant_direction(rng))
        color = rng.uniform(1.0 - spec.light_saturation, 1.0, 3)
        red, green, blue = (color * (spec.light_level * falloff / count / color.max())).tolist()
        lights.append(Light(position, (red, green, blue)))
    return tuple(lights)


@dataclass(frozen=True, eq=False)
class _Kind:
    """An object without its place."""

    shape: UnitShape
    mesh: str
    reflectance: Vector3
    specular: float
    shininess: float


def _sample_kinds(spec: DatasetSpec, index: int, objects: Objects) -> list[_Kind]:
    """Draw classes, models and materials; a model that cannot be used makes way for another."""
    rng = item_rng(spec.seed, index, Purpose.OBJECTS)
    count = int(rng.integers(spec.objects[0], spec.objects[1] + 1))
    names = [spec.shapes[i] for i in rng.integers(len(spec.shapes), size=count)]
    rng = item_rng(spec.seed, index, Purpose.MATERIALS)
    colors = rng.uniform(0.15, 0.95, (count, 3)) if spec.random_reflectance else None
    specular, shininess = (rng.uniform(*r, count).tolist() for r in (spec.specular, spec.shininess))
    kinds = []
    for k, name in enumerate(names):
        shape, mesh = _sample_model(spec, index, k, name, objects)
        red, green, blue = spec.reflectance if colors is None else colors[k].tolist()
        kinds.append(_Kind(shape, mesh, (red, green, blue), specular[k], shininess[k]))
    return kinds


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
        f" {reason}; `scenegen check-objects` tells of all"
    )


def _place_objects(
    spec: DatasetSpec, index: int, attempt: int, cameras: Sequence[Camera], kinds: list[_Kind]
) -> list[tuple[PlacedObject, Body]]:
    """Place the item's objects one after another; the list ends before the first without room."""
    rng = item_rng(spec.seed, index, Purpose.POSES, attempt)
    frustums = [
        (np.array(camera.position), frustum_normals(camera, spec.height, spec.width))
        for camera in cameras
    ]
    placed: list[tuple[PlacedObject, Body]] = []
    for kind in kinds:
        bodies = [body for _, body in placed]
        for _ in range(POSES_PER_OBJECT):
            scale = float(rng.uniform(*spec.object_radius))
            quaternion = random_rotation(kind.shape, spec.pose, rng)
            rotation = rotation_matrix(quaternion)
            body = find_place(
                kind.shape, rotation, scale, frustums, spec.allow_cropped, bodies, rng
            )
            if body is not None:
                x, y, z = body.position.tolist()
                item = PlacedObject(
                    shape=kind.shape.name,
                    position=(x, y, z),
                    rotation=quaternion,
                    scale=scale,
                    reflectance=kind.reflectance,
                    specular=kind.specular,
                    shininess=kind.shininess,
                    mesh=kind.mesh,
                )
                placed.append((item, body))
                break
        else:
            break
    return placed


def _around(center: Vector3, radius: float, direction: Vector3) -> Vector3:
    return (
        center[0] + radius * direction[0],
        center[1] + radius * direction[1],
        center[2] + radius * direction[2],
    )
