"""Folders of files become the submission that their numbers mean."""

import numpy as np
import pytest
from PIL import Image
from refusals import refused

from metrics.intake.importing import import_rooms
from metrics.intake.reading import Reading
from metrics.submissions.reader import open_predictions
from metrics.submissions.validation import validate
from scenegen.camera import pixel_directions
from scenegen.common.errors import SceneGenError
from scenegen.rooms.reader import RoomsFile


@pytest.fixture
def rooms(truths):
    with RoomsFile(truths.rooms) as file:
        yield file


def imported(tmp_path, rooms, save, ending, *, normals=None, **reading):
    """The submission that comes of what `save(path, room)` writes for every row."""
    folder = tmp_path / "out"
    folder.mkdir(exist_ok=True)
    for room in rooms:
        save(folder / f"d{room.index:02d}{ending}", room)
    how = import_rooms(
        f"{folder}/d*{ending}", rooms.path, tmp_path / "p.h5", method="m",
        reading=Reading(**reading), normals=normals, shown="first_view",
    )  # fmt: skip
    assert "d00" in how
    assert [p for p in validate(tmp_path / "p.h5", rooms.path) if not p.is_hint] == []
    return open_predictions(tmp_path / "p.h5")


def stretch(room):
    return np.linalg.norm(pixel_directions(*room.depth.shape, room.fov_y_degrees), axis=-1)


def millimetres(path, room):
    Image.fromarray(np.rint(room.depth * 1000).astype("u2")).save(path)


OPENCV = np.array([1.0, -1.0, -1.0])
CASES = {
    "millimetres": (millimetres, ".png", {"scale": 1e-3}, lambda r: r.depth, 5.1e-4),
    "distance": (lambda p, r: np.save(p, 2 * r.depth * stretch(r)), ".npy",
                 {"kind": "distance", "scale": 0.5}, lambda r: r.depth, 1e-6),
    "disparity": (lambda p, r: np.save(p, 3 / r.depth + 1), ".npy", {"kind": "disparity"},
                  lambda r: 3 / r.depth + 1, 1e-6),
    "metric disparity": (lambda p, r: np.save(p, 1 / r.depth), ".npy",
                         {"kind": "disparity", "alignment": "none"}, lambda r: r.depth, 1e-6),
    "points": (lambda p, r: np.save(p, r.points * OPENCV), ".npy",
               {"kind": "points", "alignment": "scale"}, lambda r: r.points, 1e-6),
    "our points": (lambda p, r: np.save(p, r.points[None]), ".npy",
                   {"kind": "points", "frame": "opengl"}, lambda r: r.points, 1e-6),
    "twice the size": (lambda p, r: np.save(p, np.kron(r.depth, np.ones((2, 2)))), ".npy", {},
                       lambda r: r.depth, 0.02),
    "float16": (lambda p, r: np.save(p, r.depth.astype("f2")), ".npy", {}, lambda r: r.depth, 2e-3),
}  # fmt: skip
KINDS = {"disparity": ("disparity", "scale_shift"), "metric disparity": ("depth", "none"),
         "points": ("points", "scale"), "our points": ("points", "none")}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_the_numbers_of_files_mean_the_truth(name, rooms, tmp_path):
    save, ending, reading, expected, within = CASES[name]
    with imported(tmp_path, rooms, save, ending, **reading) as found:
        assert (found.kind, found.alignment) == KINDS.get(name, ("depth", "none"))
        assert found.shown == "first_view"
        for room in rooms:
            assert np.abs(found.geometry(room.index) - expected(room)).max() < within


def test_normals_of_floats_and_of_pictures(rooms, tmp_path):
    folder = tmp_path / "normals"
    folder.mkdir()
    for encode, reading, within in (
        (lambda n: np.rint((n * OPENCV / 2 + 0.5) * 255).astype("u1"), {}, 0.005),
        (lambda n: np.rint((n / 2 + 0.5) * 255).astype("u1"), {"frame": "opengl"}, 0.005),
    ):
        for room in rooms:
            Image.fromarray(encode(room.normal)).save(folder / f"{room.index + 1}.png")
        (tmp_path / "p.h5").unlink(missing_ok=True)
        with imported(
            tmp_path,
            rooms,
            lambda p, r: np.save(p, r.depth),
            ".npy",
            normals=str(folder),
            **reading,
        ) as found:
            assert all(np.abs(found.normal(r.index) - r.normal).max() < within for r in rooms)


def test_one_file_of_all_rows(rooms, tmp_path):
    depth = rooms.read("depth", slice(None))
    np.save(tmp_path / "all.npy", depth)
    np.savez(tmp_path / "all.npz", depth[..., None])
    for name in ("all.npy", "all.npz"):
        import_rooms(
            str(tmp_path / name), rooms.path, tmp_path / "p.h5", method="m", reading=Reading(),
            overwrite=True,
        )  # fmt: skip
        with open_predictions(tmp_path / "p.h5") as found:
            assert np.array_equal(found.depth(5), depth[5])


def holes(path, room):
    values = np.rint(room.depth * 1000).astype("u2")
    values[4:7, 10:12] = 0
    Image.fromarray(values).save(path)


def test_pixels_without_a_value_are_refused_or_filled(rooms, tmp_path):
    reading = {"scale": 1e-3, "invalid": (0.0,)}
    with refused(
        SceneGenError, "d00.png (row 0): depth", found="6 pixels", hint="--missing nearest"
    ):
        imported(tmp_path, rooms, holes, ".png", **reading)
    assert not (tmp_path / "p.h5").exists()
    with imported(tmp_path, rooms, holes, ".png", missing="nearest", **reading) as found:
        depth = found.depth(2)
        assert np.isin(depth[4:7, 10:12], depth[3:8, 9:13][depth[3:8, 9:13] > 0]).all()


@pytest.mark.parametrize(
    ("save", "reading", "words"),
    [
        (lambda p, r: np.save(p, np.full((32, 32), "x")), {}, "(row 0): depth"),
        (lambda p, r: np.save(p, -r.depth), {}, "(row 0): depth"),
        (lambda p, r: np.save(p, r.points), {"kind": "points"}, "(row 0): points"),
        (lambda p, r: p.write_bytes(b"" if r.index == 5 else b"\x93NUMPY"), {}, "d00.npy"),
        (lambda p, r: r.index == 4 or np.save(p, r.depth), {}, "out"),
    ],
)
def test_what_is_no_prediction_is_named(save, reading, words, rooms, tmp_path):
    with refused(SceneGenError, words):
        imported(tmp_path, rooms, save, ".npy", **reading)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize(
    "settings",
    [
        {"kind": "distance", "alignment": "scale_shift"},
        {"kind": "points", "alignment": "median_scale"},
        {"scale": 0.0},
        {"scale": float("nan")},
    ],
)
def test_settings_that_contradict_each_other(settings):
    with pytest.raises(SceneGenError):
        Reading(**settings)
