"""Figures for papers: what is drawn, that fonts are embedded, the same bytes again."""

import base64
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from made_scores import iqtt_scores, rooms_scores, simple_rooms
from PIL import Image

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


def test_a_figure_is_the_same_again_and_embeds_its_fonts(tmp_path: Path) -> None:
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


def test_what_cannot_be_drawn_is_refused(tmp_path: Path) -> None:
    for files, settings in (
        ([simple_rooms(), iqtt_scores("mine", [1.0, 0.0, 1.0])], {}),
        ([simple_rooms()], {"name": "nonsense"}),
        ([iqtt_scores("mine", [1.0, 0.0, 1.0])], {"name": "chamfer"}),
    ):
        with pytest.raises(FigureError):
            draw_scores(tmp_path / "a.png", files, **settings)
    with pytest.raises(FigureError):
        draw_scores(tmp_path / "a.gif", [simple_rooms()])
    with pytest.raises(FigureError):
        draw_groups(tmp_path / "a.png", [iqtt_scores("mine", [1.0, 0.0, 1.0])], "size")
    assert not list(tmp_path.iterdir())


def test_a_grid_shows_rows_of_a_submission(tmp_path: Path) -> None:
    sample = Path(__file__).parents[3] / "examples" / "sample"
    files = sample / "rooms.h5", [sample / "empty-room.h5"]
    draw_grid(tmp_path / "grid.png", *files, [0, 2])
    with Image.open(tmp_path / "grid.png") as picture:
        assert picture.width > picture.height > 300
    with pytest.raises(FigureError):
        draw_grid(tmp_path / "other.png", *files, [99999])


def svg_of(url: str) -> str:
    text = base64.b64decode(url.removeprefix("data:image/svg+xml;base64,")).decode()
    ElementTree.fromstring(text)
    assert "nan" not in text
    return text


HARD = [[1.0], [2.0, 2.0], [0.0, 0.0], [1e-9, 1.0, np.nan], [1e100, 0.0], [1e-300]]


@pytest.mark.parametrize("values", HARD)
def test_charts_of_hard_values_and_names_are_whole(values) -> None:
    file = rooms_scores("$x_<b>\n日本", {"boundary_recall": values}, range(len(values)))
    first = svg_url(draw_histogram, file, "boundary_recall")
    svg_of(first)
    assert svg_url(draw_histogram, file, "boundary_recall") == first
    svg_of(svg_url(draw_scores, [file, file], "boundary_recall"))


def test_charts_by_angle_show_the_baseline_of_each_angle() -> None:
    columns = {"chamfer": [0.1, 0.3, 0.2, 0.2], "empty_room_chamfer": [0.5, 0.4, 0.3, 0.2]}
    file = rooms_scores("m", columns, [0, 0, 1, 1])
    angles = {"view_angle_degrees": np.array([0.0, 35.0, 0.0, -35.0])}
    file = rooms_scores("m", columns, [0, 0, 1, 1], by_view_angle=file.by_view_angle)
    file.columns["view_angle_degrees"] = angles["view_angle_degrees"]
    assert angle_floor(file, "0", "chamfer") == pytest.approx(0.4)
    assert angle_floor(file, "35", "chamfer") == pytest.approx(0.3)
    assert angle_floor(file, "80", "chamfer") is None
    assert angle_floor(simple_rooms(), "35", "chamfer") is None
    svg_of(svg_url(draw_groups, [simple_rooms(), simple_rooms("b")], "angle", "chamfer"))


def test_a_backend_that_an_ide_left_behind_does_not_count() -> None:
    code = "from metrics.views.figures import load_matplotlib; print(load_matplotlib().__name__)"
    backend = {"MPLBACKEND": "module://matplotlib_inline.backend_inline"}
    result = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, **backend}, text=True,
        capture_output=True, check=False,
    )  # fmt: skip
    assert (result.returncode, result.stdout.strip()) == (0, "matplotlib"), result.stderr
