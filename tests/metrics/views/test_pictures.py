"""Pictures and figures: which are shown, what they say, and values that are hard to draw."""

import base64
import io
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from made_scores import iqtt_scores, rooms_scores, simple_rooms
from PIL import Image

from metrics.measures.relief import empty_room
from metrics.prediction_writer import RoomPredictionWriter
from metrics.scoring.evaluate import open_runs, score
from metrics.scoring.metric_names import metric
from metrics.views.examples import chosen_questions, chosen_scenes, examples_of
from metrics.views.figures import (
    COLUMN,
    FigureError,
    angle_floor,
    draw_grid,
    draw_groups,
    draw_histogram,
    draw_scores,
    svg_url,
)
from metrics.views.paper import FIGURES
from metrics.views.pictures import (
    DEPTH,
    DERIVED_NORMALS,
    ERROR,
    NORMALS,
    NOT_SCORED,
    TRUE_DEPTH,
    TRUE_NORMALS,
    depth_pictures,
    normal_pictures,
)
from scenegen.rooms.reader import RoomsFile

LARGEST_ERROR = [252, 254, 164]


def decoded(url):
    data = base64.b64decode(url.removeprefix("data:image/webp;base64,"))
    return np.asarray(Image.open(io.BytesIO(data)))


def test_pictures_show_depth_on_the_truths_scale_and_errors_up_to_a_tenth_of_it():
    true = np.array([[1.0, 2.0], [3.0, np.nan]])
    predicted = np.array([[1.0, 2.2], [0.0, 5.0]])
    up = np.tile([0.0, 1.0, 0.0], (2, 2, 1))
    pictures = depth_pictures(np.zeros((2, 2, 3), np.uint8), true, predicted)
    pictures += normal_pictures(true, predicted, up, 50.0, 7 * up)
    shown = {picture.caption: decoded(picture.url) for picture in pictures}
    assert {p.caption: p.ends for p in pictures if p.bar == "error"} == {ERROR: ("0", "≥ 0.2")}
    assert {p.ends for p in pictures if p.bar == "depth"} == {("1.000", "3.000")}
    truth, depth, error = (shown[name] for name in (TRUE_DEPTH, DEPTH, ERROR))
    assert truth[0, 0].tolist() == depth[1, 0].tolist() == [68, 1, 84]
    assert truth[1, 0].tolist() == [253, 231, 36]
    assert error[0, 0].tolist() == [0, 0, 3]
    assert error[0, 1].tolist() == error[1, 0].tolist() == LARGEST_ERROR
    assert tuple(truth[1, 1]) == tuple(depth[1, 1]) == tuple(error[1, 1]) == NOT_SCORED
    assert shown[NORMALS][0, 0].tolist() == shown[TRUE_NORMALS][0, 0].tolist() == [128, 255, 128]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300, -1.0, 0.0])
def test_any_prediction_can_be_drawn(value):
    true = np.full((4, 4), 2.0)
    normal = np.full((4, 4, 3), value)
    for given in (None, normal):
        predicted = np.full((4, 4), value)
        pictures = depth_pictures(np.ones((4, 4, 3), np.uint8), true, predicted)
        pictures += normal_pictures(true, predicted, normal, 50.0, given)
        urls = {picture.caption: picture.url for picture in pictures}
        assert (DERIVED_NORMALS in urls) == (given is None)
        assert decoded(urls[ERROR])[0, 0].tolist() == LARGEST_ERROR


def test_scenes_stand_by_their_mean_with_the_view_nearest_to_it():
    scenes = np.repeat(np.arange(24), 3)
    values = np.repeat(np.arange(24.0), 3) + np.tile([-0.3, 0.1, 0.2], 24)
    chosen = chosen_scenes(scenes, values, higher_is_better=False)
    shown = {title: [entry // 3 for entry in entries] for title, entries in chosen.items()}
    assert shown == {
        "best": [0, 1, 2, 3, 4, 5],
        "median": [9, 10, 11, 12, 13, 14],
        "worst": [23, 22, 21, 20, 19, 18],
    }
    assert {entry % 3 for entries in chosen.values() for entry in entries} == {1}
    turned = chosen_scenes(scenes, values, higher_is_better=True)
    assert turned["best"] == chosen["worst"]


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8, 18, 19])
def test_no_scene_stands_twice(count):
    values = np.random.default_rng(count).normal(size=count)
    values[: count // 4] = np.nan
    chosen = chosen_scenes(np.arange(count), values, True)
    entries = [entry for shown in chosen.values() for entry in shown]
    assert len(set(entries)) == len(entries)
    assert np.isfinite(values[entries]).all()
    finite = count - count // 4
    assert len(chosen) == min(3, finite)
    assert chosen_scenes(np.arange(3), np.full(3, np.nan), True) == {}


def test_the_best_scenes_are_not_those_in_which_nothing_is_predicted(truths, tmp_path):
    """Half of the scenes are noisy truth, half the empty room, whose errors may be less."""
    path, noise, empty = tmp_path / "p.h5", np.random.default_rng(0), set()
    with (
        RoomsFile(truths.rooms) as rooms,
        RoomPredictionWriter(path, rooms.path, method="m") as out,
    ):
        for row, room in enumerate(rooms):
            depth = room.depth + noise.normal(0, 0.05, room.depth.shape)
            if room.scene.index % 2 == 0:
                empty.add(room.scene.index)
                depth, _ = empty_room(room.world_from_camera, room.fov_y_degrees, *depth.shape)
            out.add(row, depth=np.nan_to_num(depth, nan=1.0))
    with open_runs([path], truths.rooms) as runs:
        lists = examples_of(score([path], truths.rooms), runs.truth, runs.files[0])
    shown = {
        title.split()[0]: {int(example.name.split()[1].strip(",")) for example in examples}
        for title, examples in lists
    }
    assert not shown["Best"] & empty
    assert shown["Worst"] <= empty


def test_a_figure_is_the_same_again_and_embeds_its_fonts(tmp_path):
    files = [simple_rooms(), simple_rooms(method="other")]
    for suffix in ("pdf", "svg", "png"):
        for name in ("a", "b"):
            draw_scores(tmp_path / f"{name}.{suffix}", files)
        first, again = ((tmp_path / f"{name}.{suffix}").read_bytes() for name in ("a", "b"))
        assert first == again
    assert b"/FontFile2" in (tmp_path / "a.pdf").read_bytes()
    assert b"<text" not in (tmp_path / "a.svg").read_bytes()
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.width == pytest.approx(300 * COLUMN, abs=2)
    with pytest.raises(FileExistsError):
        draw_scores(tmp_path / "a.png", files)


def test_what_cannot_be_drawn_is_refused(tmp_path):
    rooms, asked = simple_rooms(), iqtt_scores("mine", [1.0, 0.0, 1.0])
    sample = Path(__file__).parents[3] / "examples" / "sample"
    files = sample / "rooms.h5", [sample / "empty-room.h5"]
    for draw, arguments in (
        (draw_scores, ["a.png", [rooms, asked]]),
        (draw_scores, ["a.png", [rooms], "nonsense"]),
        (draw_scores, ["a.png", [asked], "chamfer"]),
        (draw_scores, ["a.gif", [rooms]]),
        (draw_groups, ["a.png", [asked], "size"]),
        (draw_grid, ["a.png", *files, [99999]]),
    ):
        with pytest.raises(FigureError):
            draw(tmp_path / arguments[0], *arguments[1:])
    assert not list(tmp_path.iterdir())
    draw_grid(tmp_path / "grid.png", *files, [0, 2])
    with Image.open(tmp_path / "grid.png") as picture:
        assert picture.width > picture.height > 300


def svg_of(url):
    text = base64.b64decode(url.removeprefix("data:image/svg+xml;base64,")).decode()
    ElementTree.fromstring(text)
    assert "nan" not in text
    return text


HARD = [[1.0], [2.0, 2.0], [0.0, 0.0], [1e-9, 1.0, np.nan], [1e100, 0.0], [1e-300]]


@pytest.mark.parametrize("values", HARD)
def test_charts_of_hard_values_and_names_are_whole(values):
    file = rooms_scores("$x_<b>\n日本", {"boundary_recall": values}, range(len(values)))
    svg_of(svg_url(draw_histogram, file, "boundary_recall"))
    svg_of(svg_url(draw_scores, [file, file], "boundary_recall"))


def test_charts_by_angle_show_the_baseline_of_each_angle():
    columns = {"chamfer": [0.1, 0.3, 0.2, 0.2], "empty_room_chamfer": [0.5, 0.4, 0.3, 0.2]}
    file = rooms_scores("m", columns, [0, 0, 1, 1])
    file = rooms_scores("m", columns, [0, 0, 1, 1], by_view_angle=file.by_view_angle)
    file.columns["view_angle_degrees"] = np.array([0.0, 35.0, 0.0, -35.0])
    assert angle_floor(file, "0", "chamfer") == pytest.approx(0.4)
    assert angle_floor(file, "35", "chamfer") == pytest.approx(0.3)
    assert angle_floor(file, "80", "chamfer") is None
    assert angle_floor(simple_rooms(), "35", "chamfer") is None
    drawn = simple_rooms()
    names = ("view_angle_degrees", "empty_room_chamfer")
    drawn.columns.update({name: file.columns[name] for name in names})
    assert angle_floor(drawn, "35", "chamfer") == pytest.approx(0.3)
    svg_of(svg_url(draw_groups, [drawn, simple_rooms("b")], "angle", "chamfer"))


SHAPES, MULTIPLE, IQTT = "Shape scenes", "Multiple-shape scenes", "3D-IQTT"


# A row of each table, or more: method, data, score, labels, and the row as it is printed.
ROWS = [
    (1, "PTN", SHAPES, "hausdorff", None, "0.229"),
    (2, "Pix2Shape", MULTIPLE, "chamfer", None, "0.141 & 0.148 & 0.134 & 0.108"),
    (2, "PTN", MULTIPLE, "mse_depth", None, "0.083 & 0.1969 & 0.1982 & 0.190"),
    (3, "Human Evaluation", IQTT, "iqtt_accuracy", 0, r"0.7329 $\pm$ 0.148"),
    (3, "Pix2Shape", IQTT, "iqtt_accuracy", 1000, r"0.7012 $\pm$ 0.021"),
    (4, "Pix2Shape, adversarial loss", "ShapeNet scenes", "chamfer", None,
     "1.927 & 2.341 & 2.350 & 2.281"),
    (9, "Pix2Shape, depth supervision", MULTIPLE, "hausdorff_reverse", None,
     "0.221 & 0.243 & 0.238 & 0.254"),
    (17, "Pix2Shape, mutual information weighted 0.6", IQTT, "iqtt_accuracy", 200, "0.5854"),
]  # fmt: skip


@pytest.mark.parametrize(("number", "method", "data", "score", "labels", "printed"), ROWS)
def test_figures_are_as_printed(number, method, data, score, labels, printed):
    about = number, method, data, score, labels
    figures = [f for f in FIGURES if (f.table, f.method, f.data, f.metric, f.labels) == about]
    texts = [f.text + (rf" $\pm$ {f.spread}" if f.spread else "") for f in figures]
    assert " & ".join(texts) == printed
    angles = [f.view_angle for f in figures]
    assert angles == sorted(set(angles)) if len(angles) > 1 else angles == [None]


def test_every_figure_is_there_once():
    assert Counter(f.table for f in set(FIGURES)) == {1: 12, 2: 40, 3: 16, 4: 22, 9: 24, 17: 10}
    assert len(FIGURES) == 124
    assert all(metric(figure.metric) for figure in FIGURES)


def test_questions_are_spread_over_the_file():
    right = np.arange(100) % 2 == 0
    chosen = chosen_questions(right)
    assert chosen["correct"] == [0, 20, 40, 58, 78, 98]
    assert all(not right[i] for i in chosen["wrong"])
    assert chosen_questions(np.array([True])) == {"correct": [0]}
