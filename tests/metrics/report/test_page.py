"""The page of scores, its charts and its pictures."""

import base64
import io
import re
from dataclasses import replace

import numpy as np
import pytest
from jinja2 import UndefinedError
from pages import Page
from PIL import Image

from metrics.measures.empty_room import empty_room
from metrics.prediction_writer import RoomPredictionWriter
from metrics.report.charts import histogram, intervals
from metrics.report.html import render
from metrics.report.page import html_report
from metrics.report.pictures import view_pictures
from metrics.scoring.evaluate import score
from metrics.scoring.records import Submission
from scenegen.rooms.preview import NOTHING
from scenegen.rooms.reader import RoomsFile

CONTROLS = "\x1b[2J\x9b\u202e\u2066\x07"
HOSTILE = "</title></style><script>alert(1)</script>\"'><img src=http://x.y>&"


def test_the_page_is_whole_escapes_names_and_loads_nothing(rooms_path, tmp_path):
    path = tmp_path / "flat.h5"
    with RoomsFile(rooms_path) as rooms, RoomPredictionWriter(path, rooms_path, method="m") as out:
        for row in range(len(rooms)):  # the later a room, the more its objects stand out
            room = rooms[row]
            camera = room.world_from_camera, room.fov_y_degrees
            empty, _ = empty_room(*camera, *room.depth.shape)
            out.add(row, empty + (row + 1) / len(rooms) * (room.depth - empty))
    found = score([path], rooms_path)
    runs = (Submission(HOSTILE, "0" * 64, HOSTILE),)
    meta = replace(found.meta, truth_path=HOSTILE, warnings=(HOSTILE,), submissions=runs)
    text = html_report(replace(found, method=HOSTILE, meta=meta), rooms_path, [path])
    meta = replace(meta, truth_path=CONTROLS, warnings=(CONTROLS,))
    controls = html_report(replace(found, method=CONTROLS, meta=meta), rooms_path, [path])
    assert set(controls).isdisjoint(CONTROLS.replace("[2J", ""))
    page = Page(text)
    assert len(page.addresses) == 3 * 3 * 4
    assert all(address.startswith("data:image/png;base64,") for address in page.addresses)
    assert page.tags.isdisjoint({"script", "link", "iframe"})
    assert not any(name.startswith("on") for name in page.attributes)
    assert "@import" not in text
    words = " ".join(page.words)
    assert words.count(HOSTILE) == 6  # as title, head, warning, truth, path and run
    assert {row[0].strip() for row in page.rows} >= {*found.metrics, "noise floor"}
    best, _, worst = (words.split(f"{how} by Relief IoU")[1] for how in ("Best", "Median", "Worst"))
    assert f"row {len(found.ids) - 1}:" in best.split("Median")[0]
    assert "row 0:" in worst


def test_a_page_that_lacks_a_value_is_an_error():
    with pytest.raises(UndefinedError):
        render("leaderboard.html")


def test_pictures_show_depth_on_the_truths_scale_and_errors_in_red():
    true = np.array([[1.0, 2.0], [3.0, np.nan]])
    predicted = np.array([[1.0, 2.2], [0.0, 5.0]])
    pictures = []
    for url in view_pictures(np.zeros((2, 2, 3)), true, predicted):
        data = base64.b64decode(url.removeprefix("data:image/png;base64,"))
        pictures.append(np.asarray(Image.open(io.BytesIO(data)))[::64, ::64][:2, :2])
    _, truth, depth, error = pictures
    assert truth[0, 0].tolist() == [0, 0, 0]
    assert truth[1, 0].tolist() == [255, 255, 255]
    assert depth[1, 0].tolist() == [0, 0, 0]
    assert error[0, 0].tolist() == [255, 255, 255]
    assert error[0, 1].tolist() == error[1, 0].tolist() == [127, 0, 0]
    assert tuple(truth[1, 1]) == tuple(depth[1, 1]) == tuple(error[1, 1]) == NOTHING


@pytest.mark.parametrize("values", [[1.0], [2.0, 2.0], [0.0, 0.0], [1e-9, 1.0, np.nan], []])
def test_histograms_of_hard_values_are_whole(values):
    text = histogram(np.array(values), "a<b", "unit")
    Page(text)
    assert "nan" not in text
    assert sum(map(int, re.findall(r"to [^:]+: (\d+)<", text))) == np.isfinite(values).sum()


def test_points_over_an_angle_need_no_interval():
    text = intervals([(5, 1.0, np.nan, np.nan), (35, 2.0, 1.5, 2.5)], "t", "u")
    Page(text)
    assert text.count('class="range"') == 1
    assert text.count("<circle") == 2
    assert intervals([], "t", "u") == ""
