"""The way of a user from a folder to tables and figures, and one line for each mistake."""

import json
import os
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from measured_scenes import scene
from PIL import Image

import cli
from metrics.measured.reader import MeasuredFile
from metrics.score_file import read_scores
from metrics.scoring.metric_names import OBJECT_SCORES
from metrics.submissions.reader import open_predictions
from metrics.views.score_tables import confidence_warnings

MODEL = "def infer(image):\n    return {'depth_metric': image[..., 0] / 25.0 + 0.1}\n"
K = [[60.0, 0.0, 32.0], [0.0, 60.0, 24.0], [0.0, 0.0, 1.0]]


def bench(*arguments):
    return CliRunner().invoke(cli.bench, [str(argument) for argument in arguments])


@pytest.fixture
def here(tmp_path, monkeypatch):
    """Eight pictures with depth in millimetres, holes as 0, a camera, and groups of two."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(0)
    for name in ("rgb", "gt"):
        (tmp_path / name).mkdir()
    for i in range(8):
        depth = scene(i, 48, 64)
        steps = np.round(1000 * depth).astype(np.uint16)
        steps[rng.random(steps.shape) < 0.3] = 0
        Image.fromarray(steps).save(f"gt/depth_{i}.png")
        grey = np.round(25 * depth).astype(np.uint8)
        Image.fromarray(np.stack([grey] * 3, -1)).save(f"rgb/frame_{i}.png")
    lines = (f"frame_{i}.png,scene {i // 2}\n" for i in range(8))
    (tmp_path / "scenes.csv").write_text("".join(lines))
    (tmp_path / "K.json").write_text(json.dumps(K))
    (tmp_path / "model.py").write_text(MODEL)
    return tmp_path


def made(*more):
    return bench("truth", "--images", "rgb/*.png", "--depth", "gt/*.png", "--out", "mine.h5", *more)


WAY = (
    ["info", "mine.h5"],
    ["run", "model.py", "--data", "mine.h5", "--out", "a.h5"],
    ["import", "--depth", "gt", "--unit", "mm", "--invalid", "0", "--missing", "nearest",
     "--data", "mine.h5", "--out", "b.h5"],
    ["validate", "a.h5", "--truth", "mine.h5"],
    ["score", "a.h5", "--truth", "mine.h5", "--json", "a.json"],
    ["score", "b.h5", "--truth", "mine.h5", "--json", "b.json", "--html", "b.html"],
    ["score", "a.h5", "--truth", "mine.h5", "--protocol", "moge", "--json", "m.json"],
    ["score", "a.h5", "--truth", "mine.h5", "--protocol", "all"],
    ["compare", "a.json", "b.json", "--html", "c.html"],
    ["leaderboard", "a.json", "b.json", "m.json"],
)  # fmt: skip


def done(*commands):
    for command in commands:
        found = bench(*command)
        assert found.exit_code == 0, (command, found.output)


def test_from_a_folder_to_tables(here):
    """Each command of the way succeeds, and what it says is what was put in."""
    more = ["--intrinsics", "K.json", "--groups", "scenes.csv", "--source", "me"]
    assert made("--unit", "mm", "--invalid", "0", *more).exit_code == 0
    with MeasuredFile("mine.h5") as truth:
        depth = np.asarray(Image.open("gt/depth_3.png")) / 1000.0
        np.testing.assert_allclose(np.nan_to_num(truth.view(3).depth), depth, rtol=1e-6)
        assert (truth.name(3), truth.groups.tolist()) == ("frame_3.png", [0, 0, 1, 1, 2, 2, 3, 3])
        assert truth.matrix(3).tolist() == K
    done(*WAY)
    a, b = read_scores("a.json"), read_scores("b.json")
    assert b.metrics["abs_rel"].value < 1e-6
    assert 0.01 < a.metrics["abs_rel"].value < 0.2
    assert (a.metrics["abs_rel"].n, a.protocol, a.unit) == (4, "declared", "groups")
    refused = bench("compare", "a.json", "m.json")
    assert (refused.exit_code, refused.stderr.count("\n")) == (2, 1)
    assert Path("b.html").read_text().count("data:image/webp") >= 4
    assert not set(OBJECT_SCORES) & set(a.metrics)


def text(path, content):
    return lambda: Path(path).write_text(content)


def matrix(**places):
    def write():
        k = np.array(K)
        for place, value in places.items():
            k[int(place[1]), int(place[2])] = value
        Path("K.json").write_text(json.dumps(k.tolist()))

    return write


def saved(path, array):
    return lambda: Image.fromarray(array).save(path)


MM, CAMERA = ["--unit", "mm"], ["--intrinsics", "K.json"]
BAD = {
    "a picture without truth": (lambda: os.remove("gt/depth_3.png"), MM),
    "truth without a picture": (lambda: os.remove("rgb/frame_3.png"), MM),
    "two truths for one": (saved("gt/depth_03.png", np.ones((48, 64), "u2")), MM),
    "two truths of one name": (
        saved("gt/depth_3.tiff", np.ones((48, 64), "u2")), [*MM, "--depth", "gt"],
    ),
    "another size": (saved("gt/depth_3.png", np.ones((24, 32), np.uint16)), MM),
    "no valid pixel": (saved("gt/depth_3.png", np.zeros((48, 64), np.uint16)), MM),
    "colours for depth": (saved("gt/depth_3.png", np.full((48, 64, 3), (1, 2, 3), np.uint8)), MM),
    "an unknown ending": (
        lambda: os.rename("gt/depth_3.png", "gt/depth_3.dat"), [*MM, "--depth", "gt"],
    ),
    "no files": (lambda: None, [*MM, "--images", "none/*.png"]),
    "a dead link": (lambda: (os.remove("gt/depth_3.png"), os.symlink("no", "gt/depth_3.png")), MM),
    "unknown units": (lambda: None, []),
    "two units": (lambda: None, [*MM, "--scale", "2"]),
    "a normalised matrix": (matrix(_00=0.9, _11=1.2, _02=0.5, _12=0.5), [*MM, *CAMERA]),
    "a matrix of another size": (matrix(_00=600, _11=600, _02=320, _12=240), [*MM, *CAMERA]),
    "an infinite matrix": (matrix(_00=float("inf")), [*MM, *CAMERA]),
    "a matrix that is none": (matrix(_22=2.0), [*MM, *CAMERA]),
    "no matrix": (text("K.json", "[1, 2"), [*MM, *CAMERA]),
    "a picture without group": (
        text("scenes.csv", "frame_0.png,a\n"), [*MM, "--groups", "scenes.csv"],
    ),
    "a picture in two groups": (
        text("scenes.csv", "frame_0.png,a\nframe_0.png,b\n"), [*MM, "--groups", "scenes.csv"],
    ),
    "a layout that is not there": (lambda: None, ["--layout", "kitti", "--data", "rgb"]),
    "distances without a camera": (lambda: None, [*MM, "--kind", "distance"]),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_mistake_is_one_line(name, here):
    """The exit code is 2, and no file is left under the name of the output."""
    spoil, more = BAD[name]
    spoil()
    found = made(*more)
    assert found.exit_code == 2, found.output
    lines = found.stderr.strip().split("\n")
    assert (lines[0].startswith("Error") and len(lines) == 1) or lines[0].startswith("Usage"), lines
    assert not os.path.exists("mine.h5")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -1.0, 0.0, 1e39])
def test_what_is_no_depth_has_none(value, here):
    """Values that no sensor means are pixels without truth."""
    for i in range(8):
        depth = np.asarray(Image.open(f"gt/depth_{i}.png")) / 1000.0
        np.save(f"gt/depth_{i}.npy", np.where(depth > 0, depth, value))
    done = made("--depth", "gt/*.npy", "--unit", "m")
    assert done.exit_code == 0, done.output
    with MeasuredFile("mine.h5") as truth:
        stored = np.load("gt/depth_0.npy")
        assert np.array_equal(np.isfinite(truth.view(0).depth), (stored > 0) & (stored < 1e38))


def test_one_file_of_all_rows_with_masks_and_normals(here):
    """Normals of OpenCV's axes become ours, and have length 1; a mask of 0 takes depth out."""
    depth = np.stack([scene(i, 48, 64) for i in range(8)])
    np.savez("all.npz", depth=depth[..., None])
    np.save("normals.npy", np.broadcast_to(np.float32([0.0, 3.0, -4.0]), (8, 48, 64, 3)))
    mask = np.ones((48, 64), np.uint8)
    mask[:, :5] = 0
    (here / "masks").mkdir()
    for i in range(8):
        Image.fromarray(mask).save(f"masks/frame_{i}.png")
    more = ["--normals", "normals.npy", "--mask", "masks"]
    done = made("--unit", "m", "--depth", "all.npz", *more)
    assert done.exit_code == 0, done.output
    with MeasuredFile("mine.h5") as truth:
        view = truth.view(6)
    np.testing.assert_allclose(view.depth[:, 5:], depth[6, :, 5:], rtol=1e-6)
    assert np.isnan(view.depth[:, :5]).all()
    np.testing.assert_allclose(view.normal[7, 9], [0.0, -0.6, 0.8], rtol=1e-6)
    Image.fromarray(mask[1:]).save("masks/frame_3.png")
    found = made("--unit", "m", "--depth", "all.npz", *more, "--overwrite")
    assert (found.exit_code, found.stderr.count("\n")) == (2, 1)


def test_pictures_of_several_sizes_go_to_batches_of_one(measured, tmp_path):
    """Each call gets those of one size that follow each other; rows keep their places."""
    text = """
import numpy as np
class M:
    def infer(self, image): return {"depth_metric": np.full(image.shape[:2], image.shape[0] / 10)}
    def infer_batch(self, images):
        assert len(images) < 4
        return [self.infer(image) for image in images]
"""
    truth, out = measured(), tmp_path / "p.h5"
    (tmp_path / "m.py").write_text(text)
    for more in ([], ["--batch", "3", "--overwrite", "--restart"]):
        done = bench("run", tmp_path / "m.py", "--data", truth, "--out", out, *more)
        assert done.exit_code == 0, done.output
        with open_predictions(out) as found, MeasuredFile(truth) as file:
            for row in range(len(file)):
                height, _ = file.size(row)
                assert found.depth(row)[0, 0] == pytest.approx(height / 10)


def test_depth_of_a_picture_that_is_turned(here):
    """Truth of the stored picture is refused, and EXIF is named; that of the turned one is read."""
    exif = Image.Exif()
    exif[0x0112] = 6
    for i in range(8):
        with Image.open(f"rgb/frame_{i}.png") as picture:
            picture.rotate(90, expand=True).save(f"rgb/frame_{i}.png", exif=exif)
    assert made(*MM).exit_code == 0
    for i in range(8):
        with Image.open(f"gt/depth_{i}.png") as depth:
            Image.fromarray(np.rot90(np.asarray(depth)).copy()).save(f"gt/depth_{i}.png")
    found = made(*MM, "--overwrite")
    assert found.exit_code == 2
    assert "EXIF" in found.stderr


def linked(path):
    with h5py.File(path, "r+") as file:
        del file["images"]
        file["images"] = h5py.ExternalLink("/etc/passwd", "images")


@pytest.mark.parametrize(
    "edit",
    [
        lambda path: path.write_bytes(path.read_bytes()[: path.stat().st_size // 2]),
        lambda path: path.write_bytes(b""),
        lambda path: h5py.File(path, "w").close(),
        linked,
    ],
    ids=["truncated", "empty", "without arrays", "a link"],
)
def test_a_broken_mat_is_one_line(edit, tmp_path):
    path = tmp_path / "nyu.mat"
    with h5py.File(path, "w") as file:
        file["images"], file["depths"] = np.zeros((2, 3, 64, 48), "u1"), np.ones((2, 64, 48), "f4")
        file["scenes"] = np.zeros((1, 2))
    edit(path)
    done = bench("truth", "--layout", "nyu", "--data", path, "--out", tmp_path / "mine.h5")
    assert (done.exit_code, done.stderr.strip().count("\n")) == (2, 0), done.output
    assert not (tmp_path / "mine.h5").exists()


def test_stereo_disparity_is_depth_in_metres(here):
    """Depth = focal length in pixels x baseline / (disparity + offset), as Middlebury stores it."""
    for i in range(8):
        disparity = 60.0 * 0.2 / scene(i, 48, 64) - 1.5
        np.save(f"gt/depth_{i}.npy", disparity.astype(np.float32))
    more = ("--kind", "disparity", "--focal-baseline", "12", "--disparity-offset", "1.5")
    command = ("truth", "--images", "rgb/*.png", "--depth", "gt/*.npy", "--out", "stereo.h5")
    assert bench(*command, *more).exit_code == 0
    with MeasuredFile("stereo.h5") as file:
        assert file.read("depth", 3) == pytest.approx(scene(3, 48, 64), rel=1e-5)
    for wrong in (
        ("--kind", "disparity"),
        (*more, "--unit", "cm"),
        (*more, "--scale", "2"),
        more[2:],
    ):
        result = bench(*command, *wrong, "--overwrite")
        assert (result.exit_code, result.output.count("Traceback")) == (2, 0)


def test_confidence_comes_in_and_is_scored(here):
    assert made("--unit", "mm", "--invalid", "0", "--intrinsics", "K.json").exit_code == 0
    rng = np.random.default_rng(1)
    for i in range(8):
        depth = scene(i, 48, 64)
        error = np.abs(rng.normal(0.0, 0.1, depth.shape))
        np.save(f"p_{i}.npy", depth * (1.0 + error))
        np.save(f"e_{i}.npy", error)
    found = {}
    for meaning in ("confidence", "error"):
        result = bench(
            "import", "--depth", "p_*.npy", "--unit", "m", "--data", "mine.h5", "--out",
            f"{meaning}.h5", "--confidence", "e_*.npy", "--confidence-is", meaning,
        )  # fmt: skip
        assert result.exit_code == 0, result.output
        result = bench("score", f"{meaning}.h5", "--truth", "mine.h5", "--json",
                       f"{meaning}.json", "--html", f"{meaning}.html")  # fmt: skip
        assert result.exit_code == 0, result.output
        found[meaning] = read_scores(f"{meaning}.json")
    right, wrong = found["error"].metrics, found["confidence"].metrics
    assert right["ause_abs_rel"].value == pytest.approx(0.0, abs=1e-6)
    assert found["error"].skills["ause_abs_rel"].value == pytest.approx(1.0, abs=1e-4)
    assert wrong["aurg_abs_rel"].value < 0.0 < right["aurg_abs_rel"].value
    assert [bool(confidence_warnings(found[m])) for m in ("confidence", "error")] == [True, False]
