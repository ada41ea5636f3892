"""Which views are matched, and that labels once found are read again or refused."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from pix2shape_models import in_memory

from baselines.pix2shape import matching as module
from baselines.pix2shape.matching import FOLDER, matched_rows, pairs_of, relief_of_rows
from baselines.training.checkpoint import save_tensors
from scenegen.common.errors import FileFormatError, SpecError


@pytest.fixture
def rooms(near_path: Path) -> Any:
    return in_memory(near_path, 64)


def test_neighbours_of_one_scene_are_matched_on_either_side(rooms):
    order = torch.tensor([5, 0, 3, 6, 1, 2, 4, 7])  # rows may lie in any order
    mixed = replace(rooms, scene=rooms.scene[order], angle=rooms.angle[order])
    found = pairs_of(mixed)
    assert rooms.angle.tolist() == [0, 10, 20, 80] * 2
    assert found[0] == ([6], [3])  # row 5, 10 degrees: rows 4 and 6
    assert found[1] == ([], [4, 5])
    assert found[2] == ([], [])
    assert found[3] == ([0, 6], [])


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Match nothing: a row's relief is its number. Returns the rows that were asked for."""
    asked: list[int] = []

    def relief(rooms: Any, row: int, sides: Any) -> Any:
        asked.append(row)
        return torch.full((64, 64), row / 16)

    monkeypatch.setattr(module, "relief_of_row", relief)
    monkeypatch.setattr(module, "BLOCK", 1)
    return asked


def test_labels_are_found_once(quick, rooms, tmp_path):
    done: list[tuple[int, int]] = []
    relief = relief_of_rows(rooms, tmp_path, lambda *now: done.append(now))
    assert matched_rows(rooms).tolist() == quick == [0, 1, 2, 4, 5, 6]
    assert done == [(3, 6), (6, 6)]
    assert relief[:, 0, 0].tolist() == [0, 1 / 16, 2 / 16, 0, 4 / 16, 5 / 16, 6 / 16, 0]
    (tmp_path / FOLDER / "00001.safetensors").unlink()
    again = relief_of_rows(rooms, tmp_path)
    assert quick == [0, 1, 2, 4, 5, 6, 4, 5, 6], "of the other scene they are read"
    assert torch.equal(again, relief)


@pytest.mark.parametrize(
    ("tensors", "notes"),
    [
        ({"relief": torch.zeros(3, 64, 64, dtype=torch.float16)}, {"fingerprint": "other"}),
        ({"relief": torch.zeros(2, 64, 64, dtype=torch.float16)}, {}),
        ({"relief": torch.full((3, 64, 64), torch.nan, dtype=torch.float16)}, {}),
        ({"relief": torch.full((3, 64, 64), 7, dtype=torch.float16)}, {}),
        ({"depth": torch.zeros(3, 64, 64)}, {}),
    ],
    ids=["other rooms", "too few", "NaN", "too far", "another tensor"],
)
def test_labels_of_something_else_are_refused(tensors, notes, quick, rooms, tmp_path):
    relief_of_rows(rooms, tmp_path)
    path = tmp_path / FOLDER / "00000.safetensors"
    save_tensors(path, tensors, {"fingerprint": rooms.fingerprint, **notes})
    with pytest.raises(FileFormatError) as error:
        relief_of_rows(rooms, tmp_path)
    assert str(path) in error.value.where


@pytest.mark.parametrize("factor", [4, torch.nan])
def test_rooms_without_neighbouring_views_are_refused(factor, rooms, tmp_path):
    with pytest.raises(SpecError):
        relief_of_rows(replace(rooms, angle=factor * rooms.angle), tmp_path)
    assert not list(tmp_path.iterdir())
