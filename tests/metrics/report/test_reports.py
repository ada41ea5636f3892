"""Scores as text, Markdown, CSV and a page."""

import base64
import csv
import io
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from baselines.trivial import write_room_baseline
from metrics.report.charts import histogram, intervals
from metrics.report.page import html_report
from metrics.report.pictures import view_pictures
from metrics.report.text import markdown_report, table, write_csv
from metrics.scoring.scoring import score
from scenegen.common.text_table import number
from scenegen.rooms.preview import NOTHING

VOID = {"meta", "img", "line", "rect", "circle", "br"}


class Page(HTMLParser):
    """Checks that tags close, and collects text and addresses."""

    def __init__(self, text):
        super().__init__()
        self.open, self.addresses, self.words = [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        if tag not in VOID:
            self.open.append(tag)
        self.addresses += [value for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


@pytest.fixture(scope="module")
def scored(rooms_path, tmp_path_factory):
    path = tmp_path_factory.mktemp("reports") / "empty.h5"
    write_room_baseline("empty-room", rooms_path, path)
    return score([path], rooms_path), path


def test_the_table_shows_every_score_with_its_interval(scored):
    found, _ = scored
    text = table(found)
    for name, value in found.metrics.items():
        line = next(line for line in text.splitlines() if line.split()[:1] == [name])
        assert line.split()[1] == number(value.value)
    assert "noise floor" in text
    assert "empty-room: 8 images of 8 scenes" in text


def test_markdown_escapes_the_methods_name(scored):
    found, _ = scored
    text = markdown_report(replace(found, method="a|b_*c*<x>\nnew"))
    assert "a\\|b" in text
    assert "\nnew" not in text
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert len({len(re.findall(r"(?<!\\)\|", line)) for line in rows}) == 1


def test_csv_holds_every_item_to_the_last_digit(scored, tmp_path):
    found, _ = scored
    write_csv(found, tmp_path / "x.csv")
    with (tmp_path / "x.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["row"]) for row in rows] == found.items["row"].tolist()
    assert [float(row["chamfer"]) for row in rows] == found.items["chamfer"].tolist()
    with pytest.raises(FileExistsError):
        write_csv(found, tmp_path / "x.csv")


def test_the_page_is_whole_and_loads_nothing(scored, rooms_path):
    found, path = scored
    text = html_report(replace(found, method="<script>alert(1)</script>&"), rooms_path, [path])
    page = Page(text)
    assert page.addresses
    assert all(address.startswith("data:image/png;base64,") for address in page.addresses)
    assert "<script" not in text
    assert "http" not in text
    words = " ".join(page.words)
    for name in found.metrics:
        assert name in words
    for title in ("Best by Chamfer", "Median by Chamfer", "Worst by Chamfer", "How each number"):
        assert title in words
    worst = int(found.items["row"][np.argmax(found.items["chamfer"])])
    assert f"row {worst}:" in words.split("Worst by Chamfer")[1]


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
    assert "nan" not in text
    if values:
        Page(text)
        assert sum(map(int, re.findall(r"to [^:]+: (\d+)<", text))) == np.isfinite(values).sum()


def test_points_over_an_angle_need_no_interval():
    text = intervals([(5, 1.0, np.nan, np.nan), (35, 2.0, 1.5, 2.5)], "t", "u")
    Page(text)
    assert text.count('class="range"') == 1
    assert text.count("<circle") == 2
