"""Figures for papers: what is drawn, that fonts are embedded, the same bytes again."""

from pathlib import Path

import pytest
from made_scores import iqtt_scores, simple_rooms
from PIL import Image

from metrics.views.figures import COLUMN, FigureError, draw_grid, draw_groups, draw_scores


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
