"""Which views are matched, and that labels once found are read again or refused."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from pix2shape_models import in_memory

from baselines.pix2shape import matching as module
from baselines.pix2shape.matching import LABELS, matched_rows, pairs_of, relief_of_rows
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


def test_labels_are_found_once_and_those_of_other_rooms_are_refused(rooms, tmp_path, monkeypatch):
    asked: list[int] = []

    def relief(rooms: Any, row: int, sides: Any) -> Any:
        asked.append(row)
        return torch.full((64, 64), row / 16)

    monkeypatch.setattr(module, "relief_of_row", relief)
    found = [relief_of_rows(rooms, tmp_path) for _ in range(2)]
    assert matched_rows(rooms).tolist() == asked == [0, 1, 2, 4, 5, 6]
    assert found[0][:, 0, 0].tolist() == [0, 1 / 16, 2 / 16, 0, 4 / 16, 5 / 16, 6 / 16, 0]
    assert torch.equal(*found)
    for tensors, fingerprint in (
        ({"relief": found[0]}, "other"),
        ({"relief": found[0][:7]}, rooms.fingerprint),
        ({"depth": found[0]}, rooms.fingerprint),
    ):
        save_tensors(tmp_path / LABELS, tensors, {"fingerprint": fingerprint})
        with pytest.raises(FileFormatError):
            relief_of_rows(rooms, tmp_path)


@pytest.mark.parametrize("factor", [4, torch.nan])
def test_rooms_without_neighbouring_views_are_refused(factor, rooms, tmp_path):
    with pytest.raises(SpecError):
        relief_of_rows(replace(rooms, angle=factor * rooms.angle), tmp_path)
    assert not list(tmp_path.iterdir())
