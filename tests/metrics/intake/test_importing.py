"""Folders of files become the submission that their numbers mean."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from refusals import refused

from metrics.intake.folders import MatchError, counted, files_of, match_files
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


def pixels(path, values):
    Image.fromarray(np.rint(values).astype("u2")).save(path)


OPENCV = np.array([1.0, -1.0, -1.0])
CASES = {
    "millimetres": (lambda p, r: pixels(p, 1000 * r.depth), ".png", {"scale": 1e-3},
                    lambda r: r.depth, 5.1e-4),
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


@pytest.mark.parametrize("frame", ["opencv", "opengl"])
def test_normals_of_pictures(frame, rooms, tmp_path):
    (tmp_path / "normals").mkdir()
    for room in rooms:
        coded = room.normal * (OPENCV if frame == "opencv" else 1) / 2 + 0.5
        image = Image.fromarray(np.rint(coded * 255).astype("u1"))
        image.save(tmp_path / "normals" / f"{room.index + 1}.png")
    how = {"normals": str(tmp_path / "normals"), "frame": frame}
    with imported(tmp_path, rooms, lambda p, r: np.save(p, r.depth), ".npy", **how) as found:
        assert all(np.abs(found.normal(r.index) - r.normal).max() < 0.005 for r in rooms)


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
    values = 1000 * room.depth
    values[4:7, 10:12] = 0
    pixels(path, values)


def test_pixels_without_a_value_are_refused_or_filled(rooms, tmp_path):
    reading = {"scale": 1e-3, "invalid": (0.0,)}
    with refused(SceneGenError, "d00.png (row 0): depth", "6 pixels", hint="--missing nearest"):
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
    [{"kind": "distance", "alignment": "scale_shift"}, {"scale": 0.0}, {"scale": float("nan")},
     {"kind": "points", "alignment": "median_scale"}],
)  # fmt: skip
def test_settings_that_contradict_each_other(settings):
    with pytest.raises(SceneGenError):
        Reading(**settings)


VIEWS = [(scene, view) for scene in range(2) for view in range(2)]


def matched(names, count=4, by="number", rows=None):
    """The names of the files of the rows."""
    paths = [Path("out", name) for name in sorted(names)]
    rows = rows or [f"row {row}" for row in range(count)]
    keys = [*counted(count), VIEWS[:count]]
    return [path.name for path in match_files(paths, rows, lambda: keys, by)[0]]


@pytest.mark.parametrize(
    "names",
    [
        ["0.png", "1.png", "2.png", "3.png"],
        ["1.png", "2.png", "3.png", "4.png"],
        ["a0b.npy", "a01b.npy", "a02b.npy", "a3b.npy"],
        [f"rooms2-00000{row}-image.png" for row in range(4)],
        [f"{row}_v2.exr" for row in range(4)],
        ["first0.png", "b 1.png", "c2.png", "3.png"],
        [f"frame_{row}.png" for row in range(12)],  # 10 comes after 9
        ["s0_v0.png", "s0_v1.png", "s1_v0.png", "s1_v1.png"],
    ],
)
def test_by_number(names):
    assert matched(names, len(names)) == names


def test_by_name_and_by_order():
    names = ["b.png", "a.png", "d.png", "c.png"]
    assert matched(names, by="name") == sorted(names)
    assert matched(names, rows=[f"{letter}.jpg" for letter in "cadb"]) == [
        "c.png", "a.png", "d.png", "b.png",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["0.png", "1.png", "3.png"], "row 2"),
        (["1.png", "2.png", "4.png"], "row 2"),
        (["0.png", "1.png", "2.png", "3.png", "4.png"], "4.png"),
        (["0.png", "1.png", "2.png", "9.png"], "9.png"),
        (["a_0.png", "a_1.png", "b_1.png", "a_2.png", "a_3.png"], "a_1.png and b_1.png"),
        (["0.png", "0.npy", "1.png", "2.png", "3.png"], "0.npy and 0.png"),
        (["0.png", "1.png", "2.png", "best.png"], "best.png"),
        (["0_9.png", "1_8.png", "2_7.png", "3_6.png"], "0_9.png"),
    ],
)
def test_what_does_not_fit_is_named(names, words):
    with pytest.raises(MatchError) as caught:
        matched(names)
    assert words in f"{caught.value.where} {caught.value.found}"
    assert ("--match" in caught.value.hint) == ("png" in words and words[0] not in "49")
    if len(names) != 4:
        with pytest.raises(MatchError):
            matched(names, by="name")


def test_files_of_a_folder_or_a_pattern(tmp_path):
    for name in ("1.png", "0.png", ".hidden", "0.npy"):
        (tmp_path / name).touch()
    (tmp_path / "deeper.png").mkdir()
    assert [path.name for path in files_of(str(tmp_path))] == ["0.npy", "0.png", "1.png"]
    assert [path.name for path in files_of(str(tmp_path / "*.png"))] == ["0.png", "1.png"]
    for nothing in (str(tmp_path / "deeper.png"), str(tmp_path / "*.exr"), ""):
        with pytest.raises(MatchError):
            files_of(nothing)
    for name in ("[ab]", "run[1]", "a*b"):  # what exists means itself
        (tmp_path / name / "in").mkdir(parents=True)
        for file in ("0.png", "[1].png"):
            (tmp_path / name / "in" / file).touch()
        for pattern, count in (("in", 2), ("in/*.png", 2), ("i?/*", 2), ("in/[1].png", 1)):
            assert len(files_of(str(tmp_path / name / pattern))) == count, pattern
    (tmp_path / "notes.txt").touch()
    with pytest.raises(MatchError) as caught:
        files_of(str(tmp_path))
    assert caught.value.found == "notes.txt"
