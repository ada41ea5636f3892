"""Readers of folders of others: nerfstudio, COLMAP (text), BOP, MoGe and Hypersim.

A reader returns the views of each scene in order, each as a function that reads it.
"""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenegen.checking.views import Load, View
from scenegen.common.errors import FileFormatError, SceneGenError
from scenegen.files.images.pictures import opened_picture, read_picture
from scenegen.rooms.export.moge import log_depth

Array = NDArray[Any]
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])  # from y up and z back to y down and z forward
HALF = np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])  # from pixel centres at 0 to those at 0.5
MOST_PIXELS = 2**26
HYPERSIM_FOCAL = 886.81 / 1024  # of the width
WRONG = (KeyError, TypeError, ValueError, IndexError)  # what readers of broken files meet
Scenes = list[list[Load]]


def scenes_of(folder: Path) -> tuple[str, Scenes]:
    """Return the name of a folder's layout, and the views of its scenes.

    Raises FileFormatError where it has none of LAYOUTS, or a file is damaged; OSError.
    """
    folder.stat()  # raises where there is none
    for name, (file, read) in LAYOUTS.items():
        if paths := sorted(folder.rglob(file)):
            return name, read(paths)
    files = ", ".join(file for file, _ in LAYOUTS.values())
    raise FileFormatError(folder, "no layout that is known", f"one of the files {files}")


@contextmanager
def reading(place: Path) -> Iterator[None]:
    """Turn what readers of broken files meet into a FileFormatError."""
    try:
        yield
    except SceneGenError:
        raise
    except WRONG as error:
        found = f"{type(error).__name__}: {error!s:.80}"
        raise FileFormatError(place, found, "files as the layout has them") from error


def _json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise FileFormatError(path, f"no JSON ({error!s:.60})", "an object") from error


def _matrix(fx: float, fy: float, cx: float, cy: float) -> Array:
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def _depth(path: Path, unit: float) -> Array:
    """Return a depth map in units of the poses, NaN where it is 0 or not finite."""
    values = np.load(path) if path.suffix == ".npy" else _codes(path)[0]
    values = np.squeeze(values).astype(float) * unit
    return np.where(np.isfinite(values) & (values > 0), values, np.nan)


def _codes(path: Path) -> tuple[Array, dict[Any, Any]]:
    with opened_picture(path, MOST_PIXELS) as picture:
        return np.asarray(picture), {**picture.info}


def _normal(path: Path | None) -> Array | None:
    """Return normals, x right, y up, z to the viewer in files, with y down and z forward."""
    if path is None or not path.is_file():
        return None
    return _known_normals(read_picture(path, MOST_PIXELS) / 255 * 2 - 1) * [1, -1, -1]


def _known_normals(values: Array) -> Array:
    length = np.linalg.norm(values, axis=-1, keepdims=True)
    return np.where(np.abs(length - 1) < 0.1, values / np.maximum(length, 1e-9), np.nan)


def _image(path: Path) -> Array | None:
    return read_picture(path, MOST_PIXELS) if path.is_file() else None


def nerfstudio(paths: list[Path]) -> Scenes:
    """Read transforms.json: OpenGL cameras, planar depth in steps, 1e-3 by default."""
    return [
        [partial(_of_nerfstudio, path.parent, about, frame) for frame in frames]
        for path in paths
        for about in [_json(path)]
        for frames in [sorted(about["frames"], key=lambda frame: str(frame["file_path"]))]
    ]


def _of_nerfstudio(folder: Path, about: dict[str, Any], frame: dict[str, Any]) -> View:
    told = {**about, **frame}
    if "fl_x" not in told and "camera_angle_x" in told:
        told["fl_x"] = told["w"] / 2 / np.tan(told["camera_angle_x"] / 2)
    height, width = float(told["h"]), float(told["w"])
    matrix = _matrix(told["fl_x"], told.get("fl_y", told["fl_x"]), told.get("cx", width / 2),
                     told.get("cy", height / 2))  # fmt: skip
    depth = told.get("depth_file_path")
    unit = told.get("depth_unit_scale_factor", 1e-3)
    normal = told.get("normal_file_path")
    return View(
        matrix,
        depth=None if depth is None else _depth(folder / depth, unit),
        normal=_normal(None if normal is None else folder / normal),
        image=_image(folder / told["file_path"]),
        world_from_camera=np.array(told["transform_matrix"], float) @ FLIP,
    )


def colmap(paths: list[Path]) -> Scenes:
    """Read text models: cameras without distortion, and the points that images observe."""
    return [_of_colmap(path.parent) for path in paths]


def _of_colmap(folder: Path) -> list[Load]:
    def lines(name: str) -> list[list[str]]:
        text = (folder / name).read_text(encoding="utf-8").splitlines()
        return [line.split() for line in text if not line.startswith("#")]

    cameras = {}
    for number, model, _, _, *values in filter(None, lines("cameras.txt")):
        if model not in ("PINHOLE", "SIMPLE_PINHOLE"):
            hint = "undistort the images first: colmap image_undistorter"
            raise FileFormatError(
                folder / "cameras.txt", model, "a camera without distortion", hint
            )
        fx, fy, cx, cy = map(float, values if model == "PINHOLE" else [values[0], *values[:3]])
        cameras[number] = _matrix(fx, fy, cx, cy)
    points = {line[0]: line[1:4] for line in lines("points3D.txt") if line}
    found: list[Load] = []
    rows = lines("images.txt")
    for about, observed in zip(rows[::2], rows[1::2], strict=False):
        w, x, y, z, *moved = map(float, about[1:8])
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_quat((x, y, z, w)).as_matrix()
        pose[:3, 3] = moved
        seen = np.array(observed).reshape(-1, 3)
        seen = seen[np.array([point in points for point in seen[:, 2]], bool)]
        if len(seen):
            places = np.array([points[point] for point in seen[:, 2]], float)
            view = View(cameras[about[8]], world_from_camera=np.linalg.inv(pose), points=places,
                        pixels=seen[:, :2].astype(float))  # fmt: skip
            found.append(partial(replace, view))
    return found


def bop(paths: list[Path]) -> Scenes:
    """Read scene_camera.json of each scene: OpenCV cameras, millimetres, pixel centres at 0."""
    return [
        [partial(_of_bop, path.parent, int(key), camera) for key, camera in about.items()]
        for path in paths
        for about in [_json(path)]
    ]


def _of_bop(folder: Path, number: int, camera: dict[str, Any]) -> View:
    pose: Array | None = None
    if "cam_R_w2c" in camera:
        pose = np.eye(4)
        pose[:3, :3] = np.reshape(camera["cam_R_w2c"], (3, 3))
        pose[:3, 3] = camera["cam_t_w2c"]
        pose = np.linalg.inv(pose)
    image = next(iter(sorted((folder / "rgb").glob(f"{number:06d}.*"))), folder / "rgb")
    return View(
        np.reshape(camera["cam_K"], (3, 3)) + HALF,
        depth=_depth(folder / "depth" / f"{number:06d}.png", camera["depth_scale"]),
        image=_image(image),
        world_from_camera=pose,
    )


def moge(paths: list[Path]) -> Scenes:
    """Read meta.json of each image: single views, depth coded by its logarithm."""
    return [[partial(_of_moge, path.parent)] for path in paths]


def _of_moge(folder: Path) -> View:
    codes, about = _codes(folder / "depth.png")
    height, width = codes.shape
    return View(
        np.array(_json(folder / "meta.json")["intrinsics"]) * [[width], [height], [1]],
        depth=log_depth(codes, about),
        normal=_normal(folder / "normal.png"),
        image=_image(folder / "image.jpg"),
    )


def hypersim(paths: list[Path]) -> Scenes:
    """Read distances, normals and poses: OpenGL cameras of the set's usual lens, in asset units."""
    scenes: dict[Path, list[Load]] = {}
    for path in paths:
        scenes.setdefault(path.parent, []).append(partial(_of_hypersim, path))
    return list(scenes.values())


def _of_hypersim(path: Path) -> View:
    frame, camera = path.name.split(".")[1], path.parent.name.split("_")[1:3]
    detail = path.parents[2] / "_detail"
    about = detail / "_".join(camera)
    distance = _hdf5(path).astype(float)
    height, width = distance.shape
    focal = HYPERSIM_FOCAL * width
    lengths = (detail / "metadata_scene.csv").read_text(encoding="utf-8").splitlines()
    metres = float(dict(line.split(",")[:2] for line in lengths)["meters_per_asset_unit"])
    pose = np.eye(4)
    pose[:3, :3] = _hdf5(about / "camera_keyframe_orientations.hdf5")[int(frame)]
    pose[:3, 3] = _hdf5(about / "camera_keyframe_positions.hdf5")[int(frame)] * metres
    view = View(_matrix(focal, focal, width / 2, height / 2), distance)
    normals = path.with_name(f"frame.{frame}.normal_cam.hdf5")
    final = path.parents[1] / f"scene_{'_'.join(camera)}_final_preview"
    return View(
        view.matrix,
        depth=distance / view.stretch(),
        normal=_known_normals(_hdf5(normals)) * [1, -1, -1] if normals.is_file() else None,
        image=_image(final / f"frame.{frame}.tonemap.jpg"),
        world_from_camera=pose @ FLIP,
    )


def _hdf5(path: Path) -> Array:
    try:
        with h5py.File(path, "r") as file:
            return np.asarray(file["dataset"][()])
    except (OSError, KeyError) as error:
        raise FileFormatError(path, f"{error!s:.60}", "a file of Hypersim") from error


LAYOUTS: dict[str, tuple[str, Callable[[list[Path]], Scenes]]] = {  # told by a file, and read
    "nerfstudio": ("transforms.json", nerfstudio),
    "COLMAP": ("cameras.txt", colmap),
    "BOP": ("scene_camera.json", bop),
    "MoGe": ("meta.json", moge),
    "Hypersim": ("frame.*.depth_meters.hdf5", hypersim),
}
