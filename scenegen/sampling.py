"""DatasetSpec -> SceneSpec: all randomness ends here.

Camera, lights, and number and kinds of the objects are drawn once for an item, so that refusals
cannot bend their distributions. What a refusal draws again is the objects' sizes, orientations and
places (`attempt`).
"""

import math

import numpy as np

from scenegen.camera import Camera, Vector3
from scenegen.errors import PlacementError
from scenegen.placement import Body, find_place, frustum_normals, random_rotation
from scenegen.seeding import Purpose, item_rng
from scenegen.shapes import rotation_matrix, unit_shape
from scenegen.specs import DatasetSpec, Light, PlacedObject, SceneSpec

MAX_ATTEMPTS = 100  # scenes proposed for one item before the request is called impossible
POSES_PER_OBJECT = 8  # sizes and orientations tried for one object of a proposal


def sample_scene(spec: DatasetSpec, index: int, attempt: int = 0) -> SceneSpec | None:
    """Propose the scene of item `index`; None where this attempt could not place its objects.

    Pure: the same arguments give the same scene, on any machine, in any order. The caller renders
    a proposal, and asks for the next attempt if some object is not visible enough.
    """
    camera = _sample_camera(spec, index)
    kinds = _sample_kinds(spec, index)
    placed = _place_objects(spec, index, attempt, camera, kinds)
    if len(placed) < len(kinds):
        return None
    objects = tuple(item for item, _ in placed)
    return SceneSpec(
        index=index,
        cameras=(camera,),
        objects=objects,
        lights=_sample_lights(spec, index),
        ambient=spec.ambient,
        attenuation=spec.attenuation,
        room_reflectance=spec.reflectance,
    )


def refusal(spec: DatasetSpec, index: int, placed_but_hidden: int) -> PlacementError:
    """Say why item `index` got no scene, `placed_but_hidden` of its proposals being rendered."""
    kinds = _sample_kinds(spec, index)
    wanted = len(kinds)
    if placed_but_hidden:
        return PlacementError(
            f"item {index}: {MAX_ATTEMPTS} proposals with {wanted} objects, {placed_but_hidden} of"
            f" which were rendered, all with an object showing fewer than"
            f" {spec.min_visible_pixels} pixels; try fewer --objects, a larger --object-radius or"
            f" fewer --min-visible-pixels"
        )
    camera = _sample_camera(spec, index)
    best = max(len(_place_objects(spec, index, k, camera, kinds)) for k in range(10))
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
    azimuth = float(turn) * math.pi / 2
    radius = math.sqrt(1.0 - height * height)
    return (radius * math.cos(azimuth), float(height), radius * math.sin(azimuth))


def _sample_camera(spec: DatasetSpec, index: int) -> Camera:
    rng = item_rng(spec.seed, index, Purpose.CAMERA)
    position = _around(spec.camera_target, spec.camera_radius, octant_direction(rng))
    return Camera(position, spec.camera_target, spec.fov_y_degrees)


def _sample_lights(spec: DatasetSpec, index: int) -> tuple[Light, ...]:
    """Lights share the level equally; each colour has a random hue and its largest channel 1."""
    rng = item_rng(spec.seed, index, Purpose.LIGHTS)
    count = int(rng.integers(spec.lights[0], spec.lights[1] + 1))
    distance = spec.light_radius
    falloff = spec.attenuation[0] * distance + spec.attenuation[1] * distance**2
    lights = []
    for _ in range(count):
        position = _around(spec.camera_target, distance, octant_direction(rng))
        color = rng.uniform(0.3, 1.0, 3)
        red, green, blue = (color * (spec.light_level * falloff / count / color.max())).tolist()
        lights.append(Light(position, (red, green, blue)))
    return tuple(lights)


def _sample_kinds(spec: DatasetSpec, index: int) -> list[str]:
    rng = item_rng(spec.seed, index, Purpose.OBJECTS)
    count = int(rng.integers(spec.objects[0], spec.objects[1] + 1))
    return [spec.shapes[i] for i in rng.integers(len(spec.shapes), size=count)]


def _place_objects(
    spec: DatasetSpec, index: int, attempt: int, camera: Camera, kinds: list[str]
) -> list[tuple[PlacedObject, Body]]:
    """Place the item's objects one after another; the list ends before the first without room."""
    rng = item_rng(spec.seed, index, Purpose.POSES, attempt)
    normals = frustum_normals(camera, spec.height, spec.width)
    frustums = [(np.array(camera.position), normals)]
    placed: list[tuple[PlacedObject, Body]] = []
    for kind in kinds:
        shape = unit_shape(kind)
        bodies = [body for _, body in placed]
        for _ in range(POSES_PER_OBJECT):
            scale = float(rng.uniform(*spec.object_radius))
            quaternion = random_rotation(shape, spec.pose, rng)
            rotation = rotation_matrix(quaternion)
            body = find_place(shape, rotation, scale, frustums, spec.allow_cropped, bodies, rng)
            if body is not None:
                x, y, z = body.position.tolist()
                item = PlacedObject(kind, (x, y, z), quaternion, scale, spec.reflectance)
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
