"""Propose scenes: `DatasetSpec` and item index -> `SceneSpec`. All randomness ends here.

Camera, lights, and the number, classes and materials of objects are drawn once for an item, so that
a refused proposal cannot bend their distributions. Another attempt draws only the sizes,
orientations and places of the objects again.
"""

from collections.abc import Sequence

import numpy as np

from scenegen.camera import Camera
from scenegen.common.errors import PlacementError
from scenegen.common.rotations import rotation_matrix
from scenegen.common.seeding import Purpose, item_rng
from scenegen.description.scenes import PlacedObject, SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.objects.catalogue import Objects, objects_of
from scenegen.sampling.cameras import sample_cameras
from scenegen.sampling.lights import sample_lights
from scenegen.sampling.objects import Unplaced, sample_objects
from scenegen.sampling.placement import Body, find_place, frustum_normals
from scenegen.sampling.poses import random_rotation

MAX_ATTEMPTS = 100  # scenes proposed for one item before the request is called impossible
POSES_PER_OBJECT = 8  # sizes and orientations tried for one object of a proposal


def sample_scene(
    spec: DatasetSpec, index: int, attempt: int = 0, objects: Objects | None = None
) -> SceneSpec | None:
    """Propose the scene of item `index`; None where this attempt could not place its objects.

    Pure: the same arguments give the same scene, on any machine, in any order. The caller renders
    a proposal, and asks for the next attempt if some object is not visible enough. `objects` are
    those of the spec by default.

    Raises SpecError where no model of a class can be used.
    """
    cameras = sample_cameras(spec, index)
    unplaced = sample_objects(spec, index, objects or objects_of(spec))
    placed = _place_objects(spec, index, attempt, cameras, unplaced)
    if len(placed) < len(unplaced):
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
    """Return why item `index` got no scene, `placed_but_hidden` of its proposals being rendered."""
    wanted = len(sample_objects(spec, index, objects or objects_of(spec)))
    if placed_but_hidden:
        return PlacementError(
            f"item {index}",
            f"{MAX_ATTEMPTS} proposals with {wanted} objects, {placed_but_hidden} of which were"
            " rendered, each with an object that shows too few pixels",
            f"{spec.min_visible_pixels} pixels or more of every object",
            "try fewer --objects, a larger --object-radius or fewer --min-visible-pixels",
        )
    return PlacementError(
        f"item {index}",
        f"no room for its {wanted} objects in {MAX_ATTEMPTS} proposals",
        "room for all of them inside the walls and the image, touching nothing",
        "try fewer --objects, a smaller --object-radius or --allow-cropped",
    )


def _place_objects(
    spec: DatasetSpec, index: int, attempt: int, cameras: Sequence[Camera], unplaced: list[Unplaced]
) -> list[tuple[PlacedObject, Body]]:
    """Place the item's objects one after another; the list ends before the first without room."""
    rng = item_rng(spec.seed, index, Purpose.POSES, attempt)
    frustums = [
        (np.array(camera.position), frustum_normals(camera, spec.height, spec.width))
        for camera in cameras
    ]
    placed: list[tuple[PlacedObject, Body]] = []
    for kind in unplaced:
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
