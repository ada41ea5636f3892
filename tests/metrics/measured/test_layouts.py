"""Public sets: files as their descriptions have them, written here without the code that reads.

The originals were not at hand. Rooms are the scenes, so that a prediction has the scores on each
set that it has on the rooms, but for the steps in which the set stores depth.
"""

import json
import struct
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from scipy.io import savemat

import cli
from metrics.intake.truth_layouts import read_layout
from metrics.measured.reader import MeasuredFile
from metrics.measured.writer import TruthError
from metrics.scoring.evaluate import score
from metrics.submissions.writer import RoomPredictionWriter
from scenegen.camera import intrinsics
from scenegen.rooms.preview import srgb_bytes
from scenegen.rooms.reader import RoomsFile

HOLE = 3, 4  # a pixel of the last scene without truth
DRIVE = "2011_09_26_drive_0002_sync"


def bench(*arguments):
    return CliRunner().invoke(cli.bench, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def scenes(rooms_path):
    """Picture, depth with a hole, and pinhole matrix of the rooms of a file."""
    with RoomsFile(rooms_path) as rooms:
        found = []
        for room in rooms:
            picture = srgb_bytes(room.radiance)
            k = intrinsics(*room.depth.shape, room.fov_y_degrees, pixel_centers="half")
            found.append((picture, room.depth.copy(), k))
        found[-1][1][HOLE] = np.nan
        return found


def save(path, array):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(array).save(path)


def moge(folder, scenes):
    """MoGe, moge/utils/io.py: steps of the logarithm, 0 for unknown, `near` and `far` as texts."""
    names = []
    for i, (picture, depth, k) in enumerate(scenes):
        name = f"scene {i // 2}/{i}"
        names.append(name)
        save(folder / name / "image.jpg", picture)
        near, far = np.nanmin(depth), np.nanmax(depth)
        codes = 1 + np.round(np.log(depth / near) / np.log(far / near) * 65533)
        texts = PngInfo()
        texts.add_text("near", str(near))
        texts.add_text("far", str(far))
        codes = np.where(np.isnan(codes), 0, codes).astype(np.uint16)
        Image.fromarray(codes).save(folder / name / "depth.png", pnginfo=texts)
        normalized = k / [[depth.shape[1]], [depth.shape[0]], [1]]
        about = {"intrinsics": normalized.tolist()}
        (folder / name / "meta.json").write_text(json.dumps(about))
    (folder / ".index.txt").write_text("\n".join(names))
    return folder, []


def nyu(folder, scenes, name="depths"):
    """The labelled .mat: MATLAB 7.3, whose arrays lie in the reverse order of their axes."""
    text = h5py.special_dtype(ref=h5py.Reference)
    with h5py.File(folder / "nyu_depth_v2_labeled.mat", "w", userblock_size=512) as file:
        file["images"] = np.stack([p.transpose(2, 1, 0) for p, *_ in scenes])
        file[name] = np.stack([np.nan_to_num(d).T for _, d, _ in scenes])
        cell = file.create_dataset("scenes", (1, len(scenes)), text)
        for i in range(len(scenes)):
            codes = np.array([list(b"room_000%d" % (i // 2))], np.uint16).T
            stored = file.create_dataset(f"#refs#/{i}", data=codes)
            cell[0, i] = stored.ref
    numbers = np.arange(1, len(scenes) + 1)[:, None]
    savemat(folder / "splits.mat", {"testNdxs": numbers, "trainNdxs": numbers[:1]})
    return folder / "nyu_depth_v2_labeled.mat", ["--split", folder / "splits.mat"]


def kitti(folder, scenes):
    """Uhrig et al.: 16 bits, 256 steps a metre, 0 for nothing; sweeps of the laser lie beside."""
    lines = []
    for i, (picture, depth, k) in enumerate(scenes):
        raw, frame = f"2011_09_26/{DRIVE}/image_02/data", f"{5 * i:010d}.png"
        truth = f"{DRIVE}/proj_depth/groundtruth/image_02/{frame}"
        save(folder / "raw" / raw / frame, picture)
        steps = np.round(np.nan_to_num(depth) * 256).astype(np.uint16)
        save(folder / "train" / truth, steps)
        save(folder / "train" / truth.replace("groundtruth", "velodyne_raw"), steps)
        lines.append(f"{raw}/{frame} {truth} {k[0, 0]}")
    lines.append(f"{raw}/0000000999.png None {k[0, 0]}")
    (folder / "eigen.txt").write_text("\n".join(lines))
    projection = " ".join(map(str, np.hstack([scenes[0][2], [[44.8], [0.2], [0.003]]]).ravel()))
    calibration = folder / "raw/2011_09_26/calib_cam_to_cam.txt"
    calibration.write_text(f"calib_time: 09\nP_rect_01: 1\nP_rect_02: {projection}\n")
    return folder, ["--split", folder / "eigen.txt"]


def diode(folder, scenes):
    """DIODE's development kit: NAME.png, NAME_depth.npy (H, W, 1), NAME_depth_mask.npy."""
    for i, (picture, depth, _) in enumerate(scenes):
        name = f"indoors/scene_0000{i // 2}/scan_00001/0000{i}_00001_indoors_300_010"
        save(folder / f"{name}.png", picture)
        np.save(folder / f"{name}_depth.npy", np.nan_to_num(depth, nan=9.0)[..., None])
        np.save(folder / f"{name}_depth_mask.npy", np.isfinite(depth).astype(float))
    return folder, []


def hypersim(folder, scenes):
    """Hypersim: distances to the optical centre, half floats, NaN where there is nothing."""
    for i, (picture, depth, _) in enumerate(scenes):
        images = folder / f"ai_001_00{i // 2}/images"
        save(images / f"scene_cam_00_final_preview/frame.000{i % 2}.tonemap.jpg", picture)
        height, width = depth.shape
        focal = width / 2 / np.tan(np.radians(30))  # 60 degrees of horizontal field of view
        y, x = np.mgrid[:height, :width] + 0.5
        length = np.sqrt(((x - width / 2) / focal) ** 2 + ((y - height / 2) / focal) ** 2 + 1)
        place = images / f"scene_cam_00_geometry_hdf5/frame.000{i % 2}.depth_meters.hdf5"
        place.parent.mkdir(exist_ok=True)
        with h5py.File(place, "w") as file:
            file["dataset"] = (depth * length).astype(np.float16)
    return folder, []


def sintel(folder, scenes):
    """MPI Sintel: a tag, width and height, float32; cameras of nine and twelve float64."""
    tag = struct.pack("<f", 202021.25)
    for i, (picture, depth, k) in enumerate(scenes):
        name = f"alley_{i // 2}/frame_000{i}"
        save(folder / f"final/{name}.png", picture)
        for part in ("depth", "camdata_left"):
            (folder / part / name).parent.mkdir(parents=True, exist_ok=True)
        head = struct.pack("<ii", depth.shape[1], depth.shape[0])
        stored = np.nan_to_num(depth, nan=-1.0).astype("<f4").tobytes()
        (folder / "depth" / f"{name}.dpt").write_bytes(tag + head + stored)
        camera = np.hstack([k.ravel(), np.eye(3, 4).ravel()]).astype("<f8").tobytes()
        (folder / "camdata_left" / f"{name}.cam").write_bytes(tag + camera)
    return folder, []


# The largest error of depth that the steps of a layout explain, relative, for depths above 0.5.
LAYOUTS = {
    "moge": (moge, 1e-4),
    "nyu": (nyu, 1e-7),
    "nyu-raw": (lambda *a: nyu(*a, "rawDepths"), 1e-7),
    "kitti": (kitti, 0.5 / 256 / 0.5),
    "diode": (diode, 1e-7),
    "hypersim": (hypersim, 2.0**-11 + 1e-6),
    "sintel": (sintel, 1e-7),
}
CAMERAS = {"moge", "kitti", "sintel"}  # whose files tell it for each picture


def predict(truth, path, scenes):
    with RoomPredictionWriter(path, truth, method="m") as out:
        for row, (_, depth, _) in enumerate(scenes):
            rng = np.random.default_rng(row)
            filled = np.nan_to_num(depth, nan=1.0)
            out.add(row, filled * (1.1 + 0.1 * rng.standard_normal(depth.shape)))


@pytest.mark.parametrize("name", LAYOUTS)
def test_rooms_in_a_layout_have_the_scores_of_rooms(name, scenes, rooms_path, tmp_path):
    """Depth, holes, pictures, cameras and groups come back; so do the scores, within its steps."""
    write, step = LAYOUTS[name]
    (tmp_path / "set").mkdir()
    data, more = write(tmp_path / "set", scenes)
    out, found, expected = (tmp_path / f"{part}.h5" for part in ("truth", "found", "expected"))
    done = bench("truth", "--layout", name, "--data", data, *more, "--out", out)
    assert done.exit_code == 0, done.output
    with MeasuredFile(out) as truth:
        assert len(truth) == len(scenes)
        groups = 1 if name == "kitti" else len(scenes) // 2
        assert len(set(truth.groups.tolist())) == groups
        for row, (picture, depth, k) in enumerate(scenes):
            np.testing.assert_allclose(truth.view(row).depth, depth, rtol=step)
            lossy = name in ("moge", "hypersim")
            assert np.abs(truth.picture(row).astype(int) - picture).mean() < (9 if lossy else 1e-9)
            if name in CAMERAS:
                np.testing.assert_allclose(truth.matrix(row), k, rtol=1e-9)
    predict(out, found, scenes)
    predict(rooms_path, expected, scenes)
    ours, rooms = score([found], out).columns, score([expected], rooms_path).columns
    for metric in ("abs_rel", "rmse", "silog", "abs_rel_after_scale_shift", "sq_rel", "log10"):
        whole = ours[metric][0][:-1], rooms[metric][0][:-1]
        np.testing.assert_allclose(*whole, rtol=20 * step)


def test_cameras_are_those_of_the_kits(tmp_path):
    """NYU's camera_params.m counts pixels from 1; DIODE's intrinsics.txt is of 1024x768 pixels."""
    depth, k = np.full((480, 640), 2.0, np.float32), np.eye(3)
    data, _ = nyu(tmp_path, [(np.zeros((480, 640, 3), np.uint8), depth, k)])
    bench("truth", "--layout", "nyu", "--data", data, "--out", tmp_path / "nyu.h5")
    with MeasuredFile(tmp_path / "nyu.h5") as truth:
        first = truth.view(0).rays[0, 0]
    fx, fy, cx, cy = 518.857901, 519.469611, 325.582449, 253.736166
    np.testing.assert_allclose(first, [(1 - cx) / fx, -(1 - cy) / fy, -1], rtol=1e-6)
    depth = np.full((768, 1024), 2.0, np.float32)
    diode(tmp_path, [(np.zeros((768, 1024, 3), np.uint8), depth, k)])
    bench("truth", "--layout", "diode", "--data", tmp_path, "--out", tmp_path / "diode.h5")
    with MeasuredFile(tmp_path / "diode.h5") as truth:
        assert truth.matrix(0).ravel().tolist() == [886.81, 0, 512, 0, 927.06, 384, 0, 0, 1]


@pytest.mark.parametrize(
    ("name", "inside", "groups"),
    [
        ("hypersim", "ai_001_000", {"ai_001_000"}),
        ("moge", "scene 0", {"0", "1"}),
        ("moge", "scene 0/0", {"0"}),
        ("diode", "indoors/scene_00000/scan_00001", {"scan_00001"}),
        ("kitti", f"raw/2011_09_26/{DRIVE}", None),
    ],
)
def test_a_part_of_a_set_has_its_names_from_within(name, inside, groups, scenes, tmp_path,
                                                   monkeypatch):  # fmt: skip
    """Where its folder is named by a dot, and where by its path."""
    data, _ = LAYOUTS[name][0](tmp_path, scenes)
    (data / ".index.txt").unlink(missing_ok=True)
    monkeypatch.chdir(data / inside)
    for folder in (".", data / inside):
        if groups is None:  # the depth is elsewhere
            with pytest.raises(TruthError):
                read_layout(name, Path(folder))
            continue
        rows = read_layout(name, Path(folder))
        assert {row.group for row in rows} == groups
        assert all(row.name.strip("._") == row.name != "" for row in rows)


def listed(form, side="", zeros=10):
    return lambda frames: "\n".join(form.format(DRIVE, f"{i:0{zeros}d}", side) for i in frames)


FORMS = {
    "eigen": listed("2011_09_26/{0}/image_02/data/{1}.png"),
    "zhou": listed("2011_09_26/{0} {1} {2}", "l", 0),
    "zhou, right": listed("2011_09_26/{0} {1} {2}", "r", 0),
    "no side": listed("{0} {1}", zeros=0),
    "commas": listed("{0},{1},{2}", "l", 0),
    "short names": listed("2011_09_26/{0}/image_02/data/{1}.png", zeros=0),
    "Windows": listed("2011_09_26\\{0}\\image_03\\data\\{1}.png\r"),
    "benchmark": listed("{0}_image_{1}_image_02.png"),
    "no frame": listed("2011_09_26/{0}"),
}


@pytest.mark.parametrize("form", FORMS)
def test_lists_of_frames_of_many_habits(form, scenes, tmp_path):
    """Pictures and depth of the right camera are those of the left one, doubled; as JPEG, too."""
    kitti(tmp_path, scenes)
    for path in sorted(tmp_path.rglob("image_02/**/*.png")):
        other = Path(str(path).replace("image_02", "image_03"))
        other.parent.mkdir(parents=True, exist_ok=True)
        steps = np.asarray(Image.open(path))
        save(other, steps * 2 if steps.ndim == 2 else steps)
    for path in (tmp_path / "raw").rglob("image_03/data/*.png"):
        Image.open(path).save(path.with_suffix(".jpg"))
        path.unlink()
    calibration = tmp_path / "raw/2011_09_26/calib_cam_to_cam.txt"
    calibration.write_text(calibration.read_text() + "P_rect_03: 9 0 9 0 0 9 9 0 0 0 1 0\n")
    (tmp_path / "list.txt").write_text(FORMS[form]([5, 0]))
    if form == "no frame":
        with pytest.raises(TruthError):
            read_layout("kitti", tmp_path, tmp_path / "list.txt")
        return
    rows, right = (
        read_layout("kitti", tmp_path, tmp_path / "list.txt"),
        form in ("zhou, right", "Windows"),
    )
    assert [row.name[:37] for row in rows] == [f"{DRIVE}_{i:010d}" for i in (5, 0)]
    depth = np.nan_to_num(scenes[1][1]) * (2 if right else 1)
    read = rows[0].read()
    np.testing.assert_allclose(read.depth, depth, atol=1 / 128)
    assert (read.matrix[0, 0] == 9) == right


def test_the_sky_of_sintel_has_no_depth(scenes, tmp_path):
    picture, depth, k = scenes[0]
    sky = depth.copy()
    sky[:3] = 1e10
    sintel(tmp_path, [(picture, sky, k)])
    (row,) = read_layout("sintel", tmp_path)
    assert (row.read().depth[:3] <= 0).all()
