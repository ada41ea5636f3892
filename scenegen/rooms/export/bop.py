"""A data set of BOP: images, depth, poses, masks, and models as PLY files.

Lengths are millimetres; one scene unit counts as one metre. Models have z up and
the middle of their bounding box as origin. They are rigid: an object of another size is another
model. Cameras are x right, y down, looking along +z; the centre of the first pixel is (0, 0).

Fields have the meaning of BOP's document of formats and of the scripts `calc_gt_info`,
`calc_gt_masks` and `enumerate_test_targets` of its toolkit (T. Hodan et al., ECCV 2018).
"""

from collections import Counter
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import Lens, intrinsics
from scenegen.description.scenes import PlacedObject
from scenegen.objects.catalogue import Objects, objects_of
from scenegen.objects.scene_mesh import welded, world_from_object
from scenegen.rendering.amodal import wide_masks
from scenegen.rendering.packing import pack
from scenegen.rooms.export.coco import box
from scenegen.rooms.export.colmap import FLIP
from scenegen.rooms.export.encoding import write_json, write_png
from scenegen.rooms.export.nerfstudio import Z_UP
from scenegen.rooms.export.symmetries import Symmetries, symmetries
from scenegen.rooms.reader import Room

Array = NDArray[Any]
MILLIMETRES = 1000.0  # of a scene unit
SPLIT = "test"
LEAST_VISIBLE = 0.1  # visible fraction of an instance that a pose estimator has to find


def write(source: Any, folder: Path) -> dict[str, Any]:
    """Write a `folder.Source`; return its conventions.

    Raises SpecError as `Encoding`, and BackendError where masks cannot be rendered.
    """
    spec, encoding = source.rooms.spec, source.encoding
    objects = source.objects or objects_of(spec)
    models: dict[tuple[str, float], int] = {}
    middles: dict[str, Array] = {}  # of the bounding boxes of unit shapes
    targets = []
    for scene, views in source.views():
        place = folder / SPLIT / f"{scene:06d}"
        for name in ("rgb", "depth", "mask", "mask_visib"):
            (place / name).mkdir(parents=True)
        for item in views[0].scene.objects:
            models.setdefault((item.shape, item.scale), len(models) + 1)
            if item.shape not in middles:
                middles[item.shape] = welded(objects.shape(item.shape)).bounds.mean(axis=0)
        ids = [models[item.shape, item.scale] for item in views[0].scene.objects]
        numbers = [room.view_index for room in views]
        masks = wide_masks(pack(spec, [views[0].scene], numbers, objects), source.device)
        cameras, poses, infos = {}, {}, {}
        for room, whole in zip(views, masks, strict=True):
            name, key = f"{room.index:06d}", str(room.index)
            write_png(place / "rgb" / f"{name}.png", encoding.color_bytes(room), 8)
            write_png(place / "depth" / f"{name}.png", encoding.depth_steps(room), 16)
            cameras[key] = _camera(room, encoding.depth_unit)
            poses[key] = [
                {"obj_id": i, **_pose(room, item, middles[item.shape])}
                for i, item in zip(ids, room.scene.objects, strict=True)
            ]
            infos[key] = [
                _write_masks(place, room, k, whole[k]) for k in range(len(room.scene.objects))
            ]
            targets += [
                {"scene_id": scene, "im_id": room.index, "obj_id": i, "inst_count": count}
                for i, count in sorted(_visible_instances(ids, infos[key]).items())
            ]
        write_json(place / "scene_camera.json", cameras)
        write_json(place / "scene_gt.json", poses)
        write_json(place / "scene_gt_info.json", infos)
    write_json(folder / f"{SPLIT}_targets_bop19.json", targets)
    # That of one image; `scene_camera.json` has each image's own.
    write_json(folder / "camera.json", _sensor(spec, views[0].lens, encoding.depth_unit))
    _write_models(folder / "models", models, objects)
    return {
        "world": "right-handed, z up: our (x, y, z) is (x, -z, y) here",
        "unit": f"millimetre; 1000 are 1 {source.unit}",
        "camera": "x right, y down, looks along +z",
        "pixel_centers": "0: the centre of the first pixel is (0, 0)",
        "models": {str(i): {"shape": shape, "scale": s} for (shape, s), i in models.items()},
        "masks": "silhouettes within the image",
        "scene_gt_info": "as BOP's calc_gt_info: px_count_all, visib_fract and bbox_obj include"
        " what lies up to one image beyond the edge; boxes are from first to last pixel centre",
        "targets": f"instances with visib_fract of {LEAST_VISIBLE} or more",
        "pictures": {
            "image": {**encoding.pictures()["image"], "bits": 8},
            "depth": {"millimetres": encoding.depth_unit * MILLIMETRES, "nothing": 0},
        },
    }


def _visible_instances(ids: list[int], infos: list[dict[str, Any]]) -> Counter[int]:
    """Return how many instances of each model an image shows well enough to be found."""
    pairs = zip(ids, infos, strict=True)
    return Counter(i for i, info in pairs if info["visib_fract"] >= LEAST_VISIBLE)


def _camera(room: Room, depth_unit: float) -> dict[str, Any]:
    height, width = room.depth.shape
    matrix = intrinsics(height, width, room.lens, pixel_centers="integer")
    rotation = FLIP @ (Z_UP[:3, :3] @ room.world_from_camera[:3, :3]).T
    position = Z_UP[:3, :3] @ room.world_from_camera[:3, 3]
    return {
        "cam_K": matrix.ravel().tolist(),
        "depth_scale": depth_unit * MILLIMETRES,
        "cam_R_w2c": rotation.ravel().tolist(),
        "cam_t_w2c": (-rotation @ position * MILLIMETRES).tolist(),
    }


def _sensor(spec: Any, lens: Lens, depth_unit: float) -> dict[str, Any]:
    matrix = intrinsics(spec.height, spec.width, lens, pixel_centers="integer")
    names = {"fx": matrix[0, 0], "fy": matrix[1, 1], "cx": matrix[0, 2], "cy": matrix[1, 2]}
    size = {"width": spec.width, "height": spec.height}
    return {**names, **size, "depth_scale": depth_unit * MILLIMETRES}


def _pose(room: Room, item: PlacedObject, middle: Array) -> dict[str, Any]:
    """Return the rigid transform from an object's model to the camera, in millimetres.

    `middle` is that of the bounding box of the unit shape.
    """
    world = world_from_object(item.position, item.rotation, 1.0)
    world[:3, 3] += world[:3, :3] @ middle * item.scale
    camera_from_world = np.linalg.inv(room.world_from_camera)
    camera = camera_from_world @ world
    rotation = FLIP @ camera[:3, :3] @ Z_UP[:3, :3].T
    return {
        "cam_R_m2c": rotation.ravel().tolist(),
        "cam_t_m2c": (FLIP @ camera[:3, 3] * MILLIMETRES).tolist(),
    }


def _write_masks(place: Path, room: Room, k: int, wide: Array) -> dict[str, Any]:
    """Write both masks of the object of slot `k`; return their counts and boxes.

    `wide` is its whole silhouette on a canvas of three by three images, (3H, 3W).
    """
    height, width = room.depth.shape
    whole = wide[height : 2 * height, width : 2 * width]
    visible = room.object_id == k + 1
    for name, mask in (("mask", whole), ("mask_visib", visible)):
        write_png(place / name / f"{room.index:06d}_{k:06d}.png", mask * 255.0, 8)
    count, shown = int(wide.sum()), int(visible.sum())
    return {
        "bbox_obj": _box(wide, (width, height)) if shown else [-1] * 4,
        "bbox_visib": _box(visible) if shown else [-1] * 4,
        "px_count_all": count,
        "px_count_valid": int((whole & np.isfinite(room.depth)).sum()),
        "px_count_visib": shown,
        "visib_fract": shown / count if count else 0.0,
    }


def _box(mask: Array, origin: tuple[int, int] = (0, 0)) -> list[int]:
    """Return x, y, width and height of a mask that is not empty, as BOP's `calc_2d_bbox`.

    The width is the last column minus the first one. `origin` is the pixel (0, 0), x and y.
    """
    x, y, width, height = box(mask)
    return [x - origin[0], y - origin[1], width - 1, height - 1]


def _write_models(folder: Path, models: dict[tuple[str, float], int], objects: Objects) -> None:
    folder.mkdir()
    about, alike = {}, dict[str, Symmetries]()
    for (shape, scale), number in models.items():
        mesh = welded(objects.shape(shape))
        mesh.apply_transform(Z_UP)
        mesh.apply_translation(-mesh.bounds.mean(axis=0))
        if shape not in alike:
            alike[shape] = symmetries(mesh)
        mesh.apply_scale(scale * MILLIMETRES)
        mesh.export(folder / f"obj_{number:06d}.ply", vertex_normal=True)
        low, size = mesh.bounds[0].tolist(), mesh.extents.tolist()
        names = [f"{what}_{axis}" for what in ("min", "size") for axis in "xyz"]
        about[str(number)] = {
            "diameter": diameter(np.asarray(mesh.vertices)),
            **dict(zip(names, [*low, *size], strict=True)),
            **alike[shape].fields(scale * MILLIMETRES),
        }
    write_json(folder / "models_info.json", about)


def diameter(vertices: Array) -> float:
    """Return the largest distance between two vertices, (V, 3).

    From the outermost vertices in 26 directions it goes to the farthest vertex, and from there on,
    while the distance grows.
    """
    directions = np.array([d for d in product((-1, 0, 1), repeat=3) if any(d)], float)
    largest = 0.0
    for start in set((vertices @ directions.T).argmax(axis=0).tolist()):
        place, reached = start, -1.0
        while True:
            distances = np.linalg.norm(vertices - vertices[place], axis=1)
            farthest = int(distances.argmax())
            if distances[farthest] <= reached:
                break
            place, reached = farthest, float(distances[farthest])
        largest = max(largest, reached)
    return largest
