"""Folders with a known mistake each, and right ones: the check names the mistake and its size."""

import json
import shutil
from functools import cache, partial

import h5py
import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from scenegen import open_rooms
from scenegen.checking.folders import check_folder
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.description.presets import preset_spec
from scenegen.rooms.export.folder import export_folder
from scenegen.rooms.export.moge import write_log_depth
from scenegen.rooms.make import make_dataset

KINDS = ("shapes", "interiors")
FORMATS = ("nerfstudio", "colmap", "bop", "moge")


@pytest.fixture(scope="module")
def out(make_rooms, tmp_path_factory):
    """Return the folder of exports of rooms in two views, "shapes" or "interiors"."""
    return cache(partial(exported, make_rooms, tmp_path_factory))


def exported(make_rooms, tmp_path_factory, kind):
    folder = tmp_path_factory.mktemp(kind)
    if kind == "shapes":
        make_rooms(folder / "x.h5", 2, seed=3, views=(0.0, 20.0), height=64, width=80,
                   objects=(3, 3), shapes=("box", "pyramid", "octahedron"),
                   fov_degrees=40.0)  # fmt: skip
    else:
        make_dataset(folder / "x.h5", preset_spec("interiors", height=96, width=96, spp=16, seed=6,
                     objects=(8, 12), views=(0.0, 12.0), denoise=False), 1)  # fmt: skip
    with open_rooms(folder / "x.h5") as rooms:
        for form in FORMATS:
            export_folder(rooms, form, folder / form)
    return folder


@pytest.fixture
def spoilt(out, tmp_path):
    """Copy an export and change its files; return the report."""

    def spoil(kind, form, change):
        shutil.copytree(out(kind) / form, tmp_path / form)
        change(tmp_path / form)
        return check_folder(tmp_path / form)

    return spoil


def pixels(path):
    return np.asarray(Image.open(path)).astype(float)


def in_transforms(edit):
    """Edit transforms.json of each scene."""

    def change(folder):
        for path in folder.glob("*/transforms.json"):
            about = json.loads(path.read_text())
            edit(about)
            path.write_text(json.dumps(about))

    return change


def poses(edit):
    def change(about):
        for frame in about["frames"]:
            frame["transform_matrix"] = edit(np.array(frame["transform_matrix"])).tolist()

    return in_transforms(change)


def maps(pattern, edit):
    """Edit the PNG files of a pattern; `edit` may take the distance over the depth, too."""

    def change(folder):
        for scene in folder.glob("scene-*"):
            about = json.loads((scene / "transforms.json").read_text())
            rows, columns = np.indices((int(about["h"]), int(about["w"])))
            x = (columns + 0.5 - about["cx"]) / about["fl_x"]
            y = (rows + 0.5 - about["cy"]) / about["fl_y"]
            for path in scene.glob(pattern):
                values = np.rint(edit(pixels(path), np.sqrt(x * x + y * y + 1)))
                Image.fromarray(values.astype(np.uint16 if values.ndim == 2 else np.uint8)).save(
                    path
                )

    return change


def camera(**factors):
    return in_transforms(lambda about: about.update({k: about[k] * f for k, f in factors.items()}))


def moved(x, y):
    return in_transforms(lambda a: a.update(cx=a["cx"] + x, cy=a["cy"] + y))


FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
FORWARD = np.array([[0.0, -1, 0, 0], [0, 0, 1, 0], [-1, 0, 0, 0], [0, 0, 0, 1]])  # x ahead, z up
FAULTS = {
    "distance": (maps("depth/*.png", lambda z, long: z * long), ["distance"], None),
    "planar for distance": (maps("depth/*.png", lambda z, long: z / long), ["planar"], None),
    "half a pixel": (moved(0.5, 0.5), ["principal-point"], (0.5, 0.5)),
    "crop": (moved(-6.0, 3.0), ["principal-point"], (-6.0, 3.0)),
    "focal": (camera(fl_x=1.1, fl_y=1.1), ["focal"], (1.1,)),
    "short focal": (camera(fl_x=0.7, fl_y=0.7), ["focal"], (0.7,)),
    "unit": (camera(depth_unit_scale_factor=1000), ["unit"], (1000.0,)),
    "feet": (camera(depth_unit_scale_factor=3.2808), ["unit"], (3.2808,)),
    "inverse poses": (poses(np.linalg.inv), ["poses"], ()),
    "OpenCV axes": (poses(lambda m: m @ FLIP), ["poses"], ()),
    "ROS axes": (poses(lambda m: m @ FORWARD), ["poses"], ()),
    "both": (poses(lambda m: np.linalg.inv(m @ FLIP)), ["poses"], ()),
    "mirrored": (maps("*/*.png", lambda v, _: v[:, ::-1]), ["mirrored", "normals", "images"], None),
    "mirrored depth": (maps("depth/*.png", lambda z, _: z[:, ::-1]), ["mirrored"], None),
    "upside down": (maps("depth/*.png", lambda z, _: z[::-1]), ["upside-down"], None),
    "OpenCV normals": (maps("normals/*.png", lambda n, _: [0, 255, 255] + n * [1, -1, -1]),
                       ["normals"], None),
    "mirrored images": (maps("images/*.png", lambda v, _: v[:, ::-1]), ["images"], None),
}  # fmt: skip


SLOW = ("planar for distance", "crop", "short focal", "feet", "both", "upside down")
NAMES = [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in FAULTS]


@pytest.mark.parametrize("name", NAMES)
def test_a_mistake_is_named_with_its_size(name, spoilt):
    """Some mistakes are made in shapes, the others in interiors, which have fewer images."""
    change, expected, size = FAULTS[name]
    report = spoilt(KINDS[list(FAULTS).index(name) % 4 > 0], "nerfstudio", change)
    names = [fault.name for fault in report.faults]
    assert names[: len(expected)] == expected or sorted(names) == sorted(expected)
    assert not all(check.ok for check in report.checks)
    if size is not None:
        tolerance = 0.15 if "principal-point" in names else 0.01
        np.testing.assert_allclose(report.faults[0].size, size, rtol=0.01, atol=tolerance)
    for fault in report.faults:
        assert fault.after < 0.6 * fault.before


def in_json(pattern, edit):
    """Edit each camera of the JSON files of a pattern."""

    def change(folder):
        for path in folder.glob(pattern):
            about = json.loads(path.read_text())
            for camera in about.values():
                edit(camera)
            path.write_text(json.dumps(about))

    return change


def inverse_bop(camera):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.reshape(camera["cam_R_w2c"], (3, 3)), camera["cam_t_w2c"]
    pose = np.linalg.inv(pose)
    camera.update(cam_R_w2c=pose[:3, :3].ravel().tolist(), cam_t_w2c=pose[:3, 3].tolist())


def inverse_colmap(folder):
    for path in folder.glob("*/sparse/0/images.txt"):
        head, *lines = path.read_text().splitlines()
        for i in range(0, len(lines), 2):
            number, *words = lines[i].split()
            w, x, y, z, *place = map(float, words[:7])
            turn = Rotation.from_quat((x, y, z, w)).inv()
            x, y, z, w = turn.as_quat()
            place = -turn.apply(place)
            lines[i] = " ".join(map(str, (number, w, x, y, z, *place, *words[7:])))
        path.write_text("\n".join([head, *lines, ""]))


def half_pixel_colmap(folder):
    for path in folder.glob("*/sparse/0/cameras.txt"):
        head, *lines = path.read_text().splitlines()
        words = [line.split() for line in lines]
        moved = [" ".join([*w[:6], *(str(float(v) - 0.5) for v in w[6:])]) for w in words]
        path.write_text("\n".join([head, *moved, ""]))


def distances_moge(folder):
    for path in folder.glob("*/*/depth.png"):
        coded = Image.open(path)
        near, far = float(coded.info["near"]), float(coded.info["far"])
        depth = near * (far / near) ** ((np.asarray(coded) - 1.0) / 65533)
        matrix = np.array(json.loads((path.parent / "meta.json").read_text())["intrinsics"])
        rows, columns = np.indices(depth.shape) + 0.5
        height, width = depth.shape
        x = (columns / width - matrix[0, 2]) / matrix[0, 0]
        y = (rows / height - matrix[1, 2]) / matrix[1, 1]
        write_log_depth(path, np.where(np.asarray(coded) == 65535, np.nan, depth)
                        * np.sqrt(x * x + y * y + 1))  # fmt: skip


OTHERS = [
    ("colmap", half_pixel_colmap, "principal-point"),
    ("colmap", inverse_colmap, "poses"),
    ("bop", in_json("test/*/scene_camera.json", inverse_bop), "poses"),
    ("bop", in_json("test/*/scene_camera.json", lambda c: c.update(depth_scale=1.0)), "unit"),
]


@pytest.mark.parametrize(("form", "change", "expected"), OTHERS)
def test_other_layouts(form, change, expected, spoilt):
    assert [fault.name for fault in spoilt("shapes", form, change).faults] == [expected]


@pytest.mark.parametrize(("long", "expected"), [(False, ["planar"]), (True, [])])
def test_hypersim_has_distances(long, expected, out, tmp_path):
    """Files as the set has them, whose lens is 60 degrees wide; or with planar depth in them."""
    lens = {"fov_degrees": fov_of_hypersim(), "fov_spread_degrees": 0.0, "height": 48, "width": 64}
    how = {"spp": 1, "seed": 6, "objects": (8, 8), "views": (0, 15), "denoise": False}
    make_dataset(tmp_path / "x.h5", preset_spec("interiors", **lens, **how), 1)
    images, about = tmp_path / "h/ai_001/images", tmp_path / "h/ai_001/_detail/cam_00"
    folder = images / "scene_cam_00_geometry_hdf5"
    folder.mkdir(parents=True)
    about.mkdir(parents=True)
    with open_rooms(tmp_path / "x.h5") as rooms:
        views = list(rooms)
    poses = np.array([room.world_from_camera for room in views])
    (about.parent / "metadata_scene.csv").write_text(
        "parameter_name,parameter_value\nmeters_per_asset_unit,0.5\n"
    )
    files = {about / "camera_keyframe_orientations.hdf5": poses[:, :3, :3],
             about / "camera_keyframe_positions.hdf5": poses[:, :3, 3] * 2}  # fmt: skip
    for i, room in enumerate(views):
        stretch = np.linalg.norm(room.points, axis=-1) / room.depth
        files[folder / f"frame.{i:04d}.depth_meters.hdf5"] = room.depth * (stretch if long else 1)
        files[folder / f"frame.{i:04d}.normal_cam.hdf5"] = room.normal
    for path, values in files.items():
        with h5py.File(path, "w") as file:
            file["dataset"] = values
    report = check_folder(tmp_path / "h")
    assert (report.layout, [fault.name for fault in report.faults]) == ("Hypersim", expected)
    assert all(check.ok for check in report.checks) == (not expected)


def fov_of_hypersim():
    """Of a square image with the diagonal of a lens of 886.81 pixels at 1024 x 768."""
    return np.degrees(2 * np.arctan(np.hypot(1024, 768) / 2 / 886.81 / np.sqrt(2)))


def test_the_command_names_what_is_wrong(out, run, tmp_path):
    assert run("check", out("shapes") / "moge").exit_code == 0
    shutil.copytree(out("shapes") / "moge", tmp_path / "moge")
    distances_moge(tmp_path / "moge")
    result = run("check", tmp_path / "moge")
    assert result.exit_code == 1
    assert "distance along the ray" in result.output


def test_what_cannot_be_checked_is_refused(out, tmp_path):
    with pytest.raises(FileFormatError):
        check_folder(tmp_path)
    shutil.copytree(out("shapes") / "nerfstudio", tmp_path / "x")
    in_transforms(lambda about: [f.pop("depth_file_path") for f in about["frames"]])(tmp_path / "x")
    with pytest.raises(SpecError):
        check_folder(tmp_path / "x")
    in_transforms(lambda about: about.pop("fl_x"))(tmp_path / "x")
    with pytest.raises(FileFormatError):
        check_folder(tmp_path / "x")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("form", FORMATS)
def test_right_folders_agree(kind, form, out):
    report = check_folder(out(kind) / form)
    assert report.faults == []
    assert report.checks
    assert all(check.ok for check in report.checks)
