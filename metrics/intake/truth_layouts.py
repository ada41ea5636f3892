"""Measured truth from public sets, as they are downloaded: one function for each layout.

Each is built from the set's published description, which it names. The sets themselves were not at
hand: the tests write files of these layouts. What a set leaves open about its camera is left open.
"""

import json
import os
import re
import struct
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from metrics.intake.array_files import read_array
from metrics.intake.outputs import image_of, planar_from_distance
from metrics.measured.reader import rays_of_matrix
from metrics.measured.writer import Measured, Source, TruthError
from scenegen.common.errors import FileFormatError
from scenegen.description.specs import MAX_PIXELS
from scenegen.files import trial
from scenegen.files.images.pictures import opened_picture, picture_size, read_picture
from scenegen.files.input_file import (
    HDF5_ERRORS,
    StoredArray,
    checking,
    open_file,
    open_unchecked,
)
from scenegen.files.places import files_below
from scenegen.rooms.export.moge import log_depth

Array = NDArray[Any]
Measure = Callable[..., tuple[Array, Array | None]]  # from files to depth and matrix
PICTURES = (".png", ".jpg", ".jpeg")  # of KITTI, whose pictures many keep as JPEG
SINTEL_TAG = 202021.25  # begins files of depth and of cameras
SINTEL_SKY = 1e9  # Blender's depth of what is no surface is 1e10
DRIVE = r"(\d{4}_\d\d_\d\d_drive_\d{4}_sync)"
FRAME = re.compile(DRIVE + r"\D(?:.*\D)?(\d{10})(?!\d)")
SHORT_FRAME = re.compile(DRIVE + r"(?:\S*[\\/]|[\s,]+)(\d{1,9})(?!\d)")  # of lists alone
LEFT, RIGHT = "2", "3"  # numbers of the colour cameras


class Layout(NamedTuple):
    """A public set: how a folder or file of it is read, and what a table says of it."""

    rows: Callable[[Path, Path | None], Iterable[Source]]
    source: str
    licence: str


def read_layout(name: str, data: Path, split: Path | None = None) -> list[Source]:
    """Return the rows of a set in one of `LAYOUTS`, all or those of a split.

    Raises TruthError and FileFormatError, naming the file; OSError.
    """
    return list(LAYOUTS[name].rows(Path(os.path.abspath(data)), split))  # whose name is no dot


def _pinhole(fx: float, fy: float, cx: float, cy: float) -> Array:
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


# Of camera_params.m, for 640x480 pixels. MATLAB's first pixel has its centre at 1, ours at 0.5.
NYU_CAMERA = _pinhole(
    518.85790117450188, 519.46961112127485, 325.58244941119034 - 0.5, 253.73616633400465 - 0.5
)
DIODE_CAMERA = _pinhole(886.81, 927.06, 512.0, 384.0)  # of intrinsics.txt; 1024x768 pixels


def _matching(folder: Path, pattern: str) -> list[Path]:
    """Return the files of a pattern below a folder, in order. Raises TruthError for none."""
    paths = files_below(folder, pattern)
    if not paths:
        raise TruthError(folder, "none of its files", f"a folder with {pattern}")
    return paths


def _other(path: Path, what: str) -> Path:
    """Return the path of a file that belongs to a picture. Raises TruthError where it is not."""
    if not path.is_file():
        raise TruthError(path, f"no {what}", "a file next to its image")
    return path


def _below(folder: Path, path: Path) -> str:
    """Return the path of a folder within another one; of that itself its name."""
    return folder.name if path == folder else path.relative_to(folder).as_posix()


def _row(name: str, group: str, picture: Path, measure: Measure, *files: Path) -> Source:
    """Return a row of a picture, whose depth and matrix `measure` reads from files."""

    def read() -> Measured:
        return Measured(read_picture(picture, MAX_PIXELS), *measure(*files))

    return Source(name, group, picture_size(picture, MAX_PIXELS), read)


def moge(folder: Path, _split: Path | None) -> Iterator[Source]:
    """Yield the rows of a folder of MoGe's evaluation: image, depth.png and meta.json each.

    Groups are the folders above. Depth is planar, and coded by its logarithm between near and far.
    """
    index = folder / ".index.txt"
    lines = index.read_text(encoding="utf-8").splitlines() if index.is_file() else []
    folders = [folder / line for line in lines if line.strip()] or [
        path.parent for path in _matching(folder, "*/meta.json")
    ]
    for place in folders:
        picture = next((p for p in (place / "image.jpg", place / "image.png") if p.is_file()), None)
        if picture is None:
            raise TruthError(place, "no image.jpg", "an image next to its depth.png")
        name = _below(folder, place)
        yield _row(name, name.rpartition("/")[0] or name, picture, _of_moge, place)


def _of_moge(place: Path) -> tuple[Array, Array]:
    path = _other(place / "depth.png", "depth")
    about = _json(_other(place / "meta.json", "camera"))
    try:
        with opened_picture(path, MAX_PIXELS) as image:
            depth = log_depth(np.asarray(image), image.info)
        height, width = depth.shape
        matrix = np.array(about["intrinsics"], np.float64) * [[width], [height], [1.0]]
    except (KeyError, TypeError, ValueError) as error:
        raise TruthError(place, f"{error!s:.80}", "near, far and a matrix, as MoGe has") from error
    return depth, matrix


def _json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise TruthError(path, f"no JSON ({error!s:.60})", "an object") from error


def nyu(path: Path, split: Path | None, depths: str = "depths") -> list[Source]:
    """Return the rows of nyu_depth_v2_labeled.mat, all or those of `testNdxs` of splits.mat.

    MATLAB's axes are reversed. Groups are scenes.
    """
    try:
        trial.try_file(path)
        with open_file(path, "labelled .mat of NYU Depth V2") as file, checking(file):
            count, _, width, height = file["images"].shape
            if file[depths].shape != (count, width, height):
                found = f"shape {file[depths].shape}"
                raise TruthError(f"{path}: {depths}", found, f"{(count, width, height)}")
            scenes = [_matlab_text(file, ref) for ref in file["scenes"][()].reshape(-1)]
    except (*HDF5_ERRORS, AttributeError) as error:
        if isinstance(error, FileFormatError | TruthError):
            raise
        found = f"no images, {depths} and scenes ({error!s:.80})"
        raise TruthError(path, found, "the labelled .mat of NYU Depth V2") from error
    chosen = range(count) if split is None else _nyu_split(split, count)
    return [
        Source(f"{i + 1:04d}", scenes[i], (height, width), partial(_of_nyu, path, depths, i))
        for i in chosen
    ]


def _of_nyu(path: Path, depths: str, i: int) -> Measured:
    try:
        # `nyu` has looked at its thousands of objects.
        with open_unchecked(path, "labelled .mat of NYU Depth V2") as file:
            image, depth = (StoredArray(file[name])[i] for name in ("images", depths))
    except HDF5_ERRORS as error:
        raise TruthError(f"{path}: image {i + 1}", f"{error!s:.80}", "one to read") from error
    picture = np.ascontiguousarray(image.transpose(2, 1, 0))
    return Measured(picture, depth.T, NYU_CAMERA if depth.T.shape == (480, 640) else None)


def _matlab_text(file: h5py.File, reference: Any) -> str:
    return "".join(map(chr, np.asarray(file[reference][()], np.int64).reshape(-1)[:200].tolist()))


def _nyu_split(path: Path, count: int) -> list[int]:
    from scipy.io import loadmat

    try:
        numbers = np.asarray(loadmat(path)["testNdxs"]).reshape(-1).astype(np.int64) - 1
    except Exception as error:  # of a reader of many formats
        raise TruthError(path, f"no testNdxs ({error!s:.60})", "splits.mat of NYU") from error
    if not len(numbers) or numbers.min() < 0 or numbers.max() >= count:
        raise TruthError(path, "numbers of other images", f"1 to {count}")
    return [int(number) for number in numbers]


def kitti(folder: Path, split: Path | None) -> Iterator[Source]:
    """Yield the rows of KITTI's annotated depth, all or those of a list of the Eigen split.

    A folder holds DRIVE/proj_depth/groundtruth/image_02/FRAME.png, at any depth, and the pictures
    of the raw data, DATE/DRIVE/image_02/data/FRAME.png, with DATE/calib_cam_to_cam.txt. Depth is
    256 metres a step, 0 where nothing was measured. Groups are drives. Lists may name frames of the
    right camera, image_03, and leave out zeros before a number: `DATE/DRIVE 69 r`.
    """
    depths, pictures = dict[tuple[str, ...], Path](), dict[tuple[str, ...], Path]()
    for path in _matching(folder, "*/image_0[23]/*"):
        match, parts = FRAME.search(path.as_posix()), path.relative_to(folder).parts
        if match and path.suffix.lower() in PICTURES and "velodyne_raw" not in parts:
            places = depths if "groundtruth" in parts else pictures
            places[match[1], match[2], _side(path.as_posix())] = path
    keys = sorted(key for key in depths if key[2] == LEFT)
    if split is not None:
        lines = split.read_text(encoding="utf-8-sig", errors="replace").splitlines()
        listed = []
        for line in filter(str.strip, lines):
            match = FRAME.search(line) or SHORT_FRAME.search(line)
            if match is None:
                raise TruthError(split, repr(line[:80]), "drive and frame, as in the Eigen split")
            listed.append((match[1], f"{int(match[2]):010d}", _side(line)))
        keys = [key for key in listed if key in depths]  # 45 of 697 frames have no annotated depth
    if not keys:
        raise TruthError(folder, "no annotated depth", "DRIVE/proj_depth/groundtruth/image_02")
    for key in keys:
        drive, frame, side = key
        if key not in pictures:
            expected = f"{drive[:10]}/{drive}/image_0{side}/data/{frame}.png"
            raise TruthError(folder, f"no image of {drive}, frame {frame}", expected)
        calibration = pictures[key].parents[3] / "calib_cam_to_cam.txt"
        name = f"{drive}_{frame}" + f"_image_0{side}" * (side == RIGHT)
        measure = partial(_of_kitti, side)
        yield _row(name, drive, pictures[key], measure, depths[key], calibration)


def _side(line: str) -> str:
    """Return the number of the camera that a path or a line names; the left one by default."""
    match = re.search(r"image_0([23])|[\s,]r\s*$", line)
    return (match[1] or RIGHT) if match else LEFT


def _of_kitti(side: str, path: Path, calibration: Path) -> tuple[Array, Array | None]:
    matrix = None
    if calibration.is_file():
        text = calibration.read_text(encoding="utf-8", errors="replace")
        line = re.search(rf"^P_rect_0{side}: (.+)$", text, re.MULTILINE)
        numbers = line[1].split() if line else []
        try:
            matrix = np.array(numbers, np.float64).reshape(3, 4)[:, :3]
        except ValueError as error:
            found = f"no P_rect_0{side} of 12 numbers"
            raise TruthError(calibration, found, "KITTI's file") from error
    return read_array(path) / 256.0, matrix


def diode(folder: Path, _split: Path | None) -> Iterator[Source]:
    """Yield the rows of DIODE: NAME.png, NAME_depth.npy and NAME_depth_mask.npy each.

    Groups are scans. The camera is that of the set's development kit.
    """
    for path in _matching(folder, "*_depth.npy"):
        stem = path.name.removesuffix("_depth.npy")
        picture = _other(path.with_name(f"{stem}.png"), "picture")
        mask = path.with_name(f"{stem}_depth_mask.npy")
        yield _row(picture.stem, _below(folder, path.parent), picture, _of_diode, path, mask)


def _of_diode(path: Path, mask_path: Path) -> tuple[Array, Array | None]:
    depth = image_of(read_array(path), "depth")
    mask = image_of(read_array(_other(mask_path, "mask")), "mask")
    if mask.shape != depth.shape:
        raise TruthError(mask_path, f"shape {mask.shape}", f"{depth.shape}, as the depth")
    return np.where(mask > 0.0, depth, 0.0), DIODE_CAMERA if depth.shape == (768, 1024) else None


def hypersim(folder: Path, _split: Path | None) -> Iterator[Source]:
    """Yield the rows of Hypersim: distances along rays, which become planar depth.

    SCENE/images/scene_CAM_geometry_hdf5/frame.NNNN.depth_meters.hdf5 with the tone-mapped pictures
    of scene_CAM_final_preview. The camera is the set's usual one, 886.81 pixels at a width of 1024;
    a few scenes have others, which their files do not tell here. Groups are scenes.
    """
    for path in _matching(folder, "*/images/scene_*_geometry_hdf5/frame.*.depth_meters.hdf5"):
        camera = path.parent.name.removesuffix("_geometry_hdf5")
        frame = path.name.replace("depth_meters.hdf5", "tonemap.jpg")
        picture = _other(path.parents[1] / f"{camera}_final_preview" / frame, "picture")
        scene = path.parents[2].name
        yield _row(f"{scene}_{camera}_{frame.split('.')[1]}", scene, picture, _of_hypersim, path)


def _of_hypersim(path: Path) -> tuple[Array, Array]:
    try:
        with open_file(path, "file of distances") as file, checking(file):
            distance = image_of(file["dataset"][()], "dataset")
    except HDF5_ERRORS as error:
        if isinstance(error, FileFormatError):
            raise
        raise TruthError(path, f"{error!s:.80}", "a data set named dataset") from error
    height, width = distance.shape
    focal = 886.81 * width / 1024
    matrix = _pinhole(focal, focal, width / 2, height / 2)
    rays = rays_of_matrix(matrix, (height, width), height, width)
    return planar_from_distance(distance, rays), matrix


def sintel(folder: Path, _split: Path | None) -> Iterator[Source]:
    """Yield the rows of MPI Sintel: depth/SCENE/frame_NNNN.dpt and the pictures of the final pass.

    Cameras are those of camdata_left, where it is there. Groups are scenes.
    """
    for path in _matching(folder, "*/depth/*/frame_*.dpt"):
        scene, root = path.parent.name, path.parents[2]
        picture = _other(root / "final" / scene / f"{path.stem}.png", "image of the final pass")
        camera = root / "camdata_left" / scene / f"{path.stem}.cam"
        yield _row(f"{scene}_{path.stem}", scene, picture, _of_sintel, path, camera)


def _of_sintel(path: Path, camera: Path) -> tuple[Array, Array | None]:
    data = _tagged(path)
    width, height = struct.unpack("<ii", data[:8]) if len(data) >= 8 else (0, 0)
    if min(width, height) < 1 or len(data) != 8 + 4 * width * height:
        raise TruthError(path, f"{len(data)} bytes for {height}x{width}", "4 bytes a pixel")
    depth = np.frombuffer(data[8:], "<f4").reshape(height, width)
    depth = np.where(depth < SINTEL_SKY, depth, 0.0)
    matrix = None
    if camera.is_file():
        numbers = _tagged(camera)
        if len(numbers) != 8 * 21:
            raise TruthError(camera, f"{len(numbers)} bytes", "matrices of 9 and 12 numbers")
        matrix = np.frombuffer(numbers[:72], "<f8").reshape(3, 3)
    return depth, matrix


def _tagged(path: Path) -> bytes:
    """Return what follows the tag of a file of Sintel. Raises TruthError."""
    data = path.read_bytes()
    if data[:4] != struct.pack("<f", SINTEL_TAG):
        raise TruthError(path, "no tag of Sintel", "a .dpt or .cam file")
    return data[4:]


LAYOUTS = {
    "moge": Layout(moge, "MoGe's evaluation data (github.com/microsoft/MoGe, docs/eval.md)",
                   "that of each set"),
    "nyu": Layout(nyu, "NYU Depth V2, Silberman et al. 2012: depths (filled)", "not stated"),
    "nyu-raw": Layout(partial(nyu, depths="rawDepths"),
                      "NYU Depth V2, Silberman et al. 2012: rawDepths", "not stated"),
    "kitti": Layout(kitti, "KITTI depth, Uhrig et al. 2017, and raw data, Geiger et al. 2013",
                    "CC BY-NC-SA 3.0"),
    "diode": Layout(diode, "DIODE, Vasiljevic et al. 2019, and its development kit", "MIT"),
    "hypersim": Layout(hypersim, "Hypersim, Roberts et al. 2021", "CC BY-SA 3.0"),
    "sintel": Layout(sintel, "MPI Sintel depth, Butler et al. 2012", "not stated"),
}  # fmt: skip
