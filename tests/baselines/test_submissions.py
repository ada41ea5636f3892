"""What holds for every submission: valid, from images and cameras alone, whole or not there."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from h5_edits import damaged_chunk, gone, put, values
from pix2shape_models import edited, released
from refusals import refused
from untrained import Write, answer_writers, room_writers

from iqtt import SplitSpec, make_split
from metrics.scoring.evaluate import score
from metrics.submissions.validation import validate
from scenegen.common.errors import SceneGenError

TRUTH = (
    "depth", "normal", "object_id", "object/shape", "object/world_from_object", "object/scale",
    "object/visible_pixels", "object/count", "light/position", "light/color", "light/ambient",
    "light/attenuation", "material/reflectance", "view_angle_degrees",
)  # fmt: skip
OWN_IMAGE = ("depth-supervised",)  # the others see a scene's view 0 alone
ROOMS = ("pix2shape", "pix2shape-rays", "ptn", "depth-supervised", "depth-completed")
QUESTIONS = (
    "pix2shape", "cnn", "siamese", "depth-match", "ptn", "rezende, 0 labels", "rezende, 5 labels"
)  # fmt: skip
of_rooms = pytest.mark.parametrize("name", ROOMS)
VARIANTS = ("pix2shape-rays", "depth-completed", "siamese", "rezende, 5 labels", "depth-match")


def but_variants(names: tuple[str, ...]) -> Any:
    """Leave to the slow tests what reads files as another method does, or takes seconds."""
    marked = [pytest.param(n, marks=[pytest.mark.slow] * (n in VARIANTS)) for n in names]
    return pytest.mark.parametrize("name", marked)


Fields = dict[str, Any]


@pytest.fixture(scope="module")
def writers(tmp_path_factory: pytest.TempPathFactory, train_questions: Path) -> Any:
    """Return the writers of submissions for rooms, and for questions."""
    folders = (tmp_path_factory.mktemp(name) for name in ("rooms", "questions"))
    return room_writers(next(folders)), answer_writers(next(folders), train_questions)


@pytest.fixture(autouse=True)
def few_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """9 rows take three batches, and do not fill the last one."""
    monkeypatch.setattr("baselines.pix2shape.predict.BATCH", 4)


def submitted(write: Write, data: Path, out: Path) -> Fields:
    """Return datasets and attributes of a submission."""
    write(data, out, overwrite=True)
    with h5py.File(out) as file:
        return {name: file[name][()] for name in file} | dict(file.attrs)


def same(one: Fields, other: Fields) -> bool:
    arrays = [name for name, value in one.items() if isinstance(value, np.ndarray)]
    return all(np.array_equal(one[name], other[name]) for name in arrays)


@of_rooms
def test_rooms_are_predicted_and_can_be_scored(name, writers, turned_path, tmp_path):
    done, out = [], tmp_path / "p.h5"
    writers[0][name](turned_path, out, progress=lambda *now: done.append(now))
    assert (sum(rows for rows, _ in done), {total for _, total in done}) == (9, {9})
    assert [problem for problem in validate(out) if not problem.is_hint] == []
    found = score([out])
    assert found.method == name
    assert all(np.isfinite(found.metrics[m].value) for m in ("chamfer", "mse_depth"))
    fields = submitted(writers[0][name], turned_path, out)
    assert len({depth.tobytes() for depth in fields["depth"]}) == 9
    np.testing.assert_allclose(np.linalg.norm(fields["normal"], axis=-1), 1, rtol=1e-4)


@of_rooms
def test_an_image_says_something_about_the_views_that_are_said(
    name, writers, turned_path, tmp_path
):
    """Row 3 is view 0 of scene 1, row 4 its view 1."""
    noise = np.random.default_rng(0).integers(0, 255, (32, 32, 3), "u1")
    write, own = writers[0][name], name in OWN_IMAGE
    before = submitted(write, turned_path, tmp_path / "p.h5")["depth"]
    for row, expected in ((3, [3] if own else [3, 4, 5]), (4, [4] if own else [])):
        path = edited(turned_path, tmp_path / f"{row}.h5", put("image", row, noise))
        found = submitted(write, path, tmp_path / "q.h5")["depth"]
        assert [i for i in range(9) if (found[i] != before[i]).any()] == expected


@of_rooms
def test_cameras_are_read_and_nothing_of_the_truth(name, writers, turned_path, tmp_path):
    edits = [values(name, np.zeros_like) for name in TRUTH]
    edits.append(values("scene", lambda old: np.full_like(old, b"{}")))
    blank = edited(turned_path, tmp_path / "blank.h5", *edits)
    expected = submitted(writers[0][name], turned_path, tmp_path / "p.h5")
    assert same(submitted(writers[0][name], blank, tmp_path / "q.h5"), expected)
    moved = put("camera/world_from_camera", (4, 0, 3), 1.6)
    path = edited(turned_path, tmp_path / "camera.h5", moved)
    found = submitted(writers[0][name], path, tmp_path / "q.h5")
    assert not np.array_equal(found["depth"][4], expected["depth"][4])


BAD_ROOMS: dict[str, tuple[Callable[[h5py.File], Any], str]] = {
    "camera": (put("camera/world_from_camera", (4, 1, 3), np.nan), "camera/world_from_camera, row"),
    "image": (damaged_chunk("image", 3), "image, row 3"),
    "truth": (damaged_chunk("depth", 3), "depth, row 3"),
}


@but_variants(ROOMS)
@pytest.mark.parametrize("bad", [*BAD_ROOMS, "size", "radiance", "no HDF5", "nothing"])
def test_rooms_that_cannot_be_predicted_leave_what_was_there(
    name, bad, writers, turned_path, float_path, make_rooms, tmp_path
):
    path, where = {"size": float_path, "nothing": tmp_path / "none.h5"}.get(bad, turned_path), ""
    if bad in BAD_ROOMS:
        edit, where = BAD_ROOMS[bad]
        path = edited(turned_path, tmp_path / "bad.h5", edit)
    elif bad == "radiance":
        path = make_rooms(tmp_path / "bright.h5", 2, image_dtype="float32")
        path, where = edited(path, tmp_path / "bad.h5", put("image", (1, 4, 4), np.inf)), "row 1"
    elif bad == "no HDF5":
        (path := tmp_path / "text.h5").write_text("text")
    out = tmp_path / "p.h5"
    for before in (None, "mine"):
        if before:
            out.write_text(before)
        with pytest.raises((SceneGenError, OSError)) as error:
            writers[0][name](path, out, overwrite=True)
        assert str(path) in str(error.value)
        assert where in str(error.value)
        assert out.exists() == bool(before)
    assert out.read_text() == "mine"
    with pytest.raises(FileExistsError):
        writers[0][name](turned_path, out)


@but_variants(QUESTIONS)
def test_answers_are_valid_and_read_no_answers_lights_or_shapes(name, writers, truths, tmp_path):
    write, done = writers[1][name], []
    write(truths.iqtt, tmp_path / "a.h5", progress=lambda *now: done.append(now))
    assert (sum(rows for rows, _ in done), {total for _, total in done}) == (6, {6})
    assert validate(tmp_path / "a.h5", truths.iqtt) == []
    assert score([tmp_path / "a.h5"]).method == name.partition(",")[0]
    path = Path(truths.iqtt).with_name("iqtt-val.h5")
    expected = submitted(write, path, tmp_path / "b.h5")
    assert expected["scores"].shape == (6, 3)
    bare = edited(path, tmp_path / "bare.h5", gone("answers", "truth"))
    assert same(submitted(write, bare, tmp_path / "b.h5"), expected)
    plain = released(tmp_path / "released.h5", [0] * 6)
    with h5py.File(plain, "r+") as file, h5py.File(path) as questions:
        file["questions"][:] = questions["questions"][:] / np.float32(255)
    found = submitted(write, plain, tmp_path / "b.h5")["scores"]
    np.testing.assert_allclose(found, expected["scores"], rtol=2e-3, atol=1e-4)


@but_variants(QUESTIONS)
def test_questions_of_two_answers(name, writers, tmp_path):
    """A softmax has as many outputs as in training; all others compare any two images."""
    spec = SplitSpec(
        train=0, labeled=0, val=0, test=5, cubes=(8, 8), distractors="mirror-pair", answers=2,
        height=32, width=32, min_cube_pixels=0,
    )  # fmt: skip
    make_split(tmp_path / "two", spec)
    path, out = tmp_path / "two" / "iqtt-test.h5", tmp_path / "a.h5"
    if name != "cnn":
        assert submitted(writers[1][name], path, out)["scores"].shape == (5, 2)
        return
    with refused(SceneGenError, found="questions with 2 options"):
        writers[1][name](path, out)


@but_variants(QUESTIONS)
@pytest.mark.parametrize("bad", ["rooms", "training", "size", "image", "none", "no HDF5"])
def test_questions_that_cannot_be_answered_leave_nothing(
    name, bad, writers, truths, train_questions, rooms_path, tmp_path
):
    own = Path(truths.iqtt)
    path = {"rooms": rooms_path, "training": train_questions}.get(bad, tmp_path / "bad.h5")
    if bad == "size":
        released(path, [0], size=24)
    elif bad == "image":
        edited(own, path, damaged_chunk("questions", 1))
    elif bad == "none":
        released(path, [0])
        with h5py.File(path, "r+") as file:
            images = file["questions"][:0]
            del file["questions"]
            file["questions"] = images
    elif bad == "no HDF5":
        path.write_text("text")
    with pytest.raises((SceneGenError, OSError)) as error:
        writers[1][name](path, tmp_path / "a.h5")
    assert str(path) in str(error.value) or bad == "rooms"
    assert not (tmp_path / "a.h5").exists()
