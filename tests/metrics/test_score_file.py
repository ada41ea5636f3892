"""Score files written and read: the same bits, a fixed text, nothing half written."""

import json
import math
import os
from dataclasses import replace

import made_scores
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refused

from metrics.score_file import JsonError, Score, read_scores, to_json, write_scores


def test_what_is_written_reads_back_to_the_same_bits(tmp_path):
    scores = made_scores.simple_rooms(
        runs=3, noise_floors={"chamfer": 0.1 + 0.2}, warnings=("a", "b")
    )
    path = tmp_path / "scores.json"
    write_scores(scores, path)
    found = read_scores(path)
    assert found.path == path
    for name in ("task", "method", "comparable", "alignment", "metrics", "meta", "by_view_angle"):
        assert getattr(found, name) == getattr(scores, name), name
    assert found.items.keys() == scores.items.keys()
    for name, column in scores.items.items():
        assert found.items[name].tobytes() == column.astype(found.items[name].dtype).tobytes()
    assert (found.runs, [*found.ids], [*found.clusters]) == (3, [0, 1, 2, 3], [0, 0, 1, 1])
    assert to_json(found) == path.read_text()
    assert path.read_text().endswith("}\n")


@given(st.lists(st.floats(0.0, 1e300), min_size=1, max_size=6))
def test_every_double_survives(values):
    scores = made_scores.rooms_scores("m", {"chamfer": [0.5] * len(values)}, range(len(values)))
    held = dict(scores.items) | {"rmse": np.array(values)}
    assert json.loads(to_json(replace(scores, items=held)))["items"]["rmse"] == values


def test_scores_are_means_over_scenes_not_images(tmp_path):
    scores = made_scores.rooms_scores("m", {"chamfer": [0.1, 0.1, 0.1, 0.5]}, [7, 7, 7, 2])
    assert scores.metrics["chamfer"].value == pytest.approx(0.3)
    write_scores(scores, tmp_path / "s.json")
    other = {"chamfer": replace(scores.metrics["chamfer"], value=0.31)}
    with refused(JsonError, "s.json: metrics.chamfer.value", found="0.31", expected="0.3"):
        write_scores(replace(scores, metrics=other), tmp_path / "s.json", overwrite=True)
    empty = {name: column[:0] for name, column in scores.items.items()}
    with refused(JsonError, "s.json: items"):
        write_scores(replace(scores, items=empty), tmp_path / "s.json", overwrite=True)


def test_view_angles_may_be_unknown(tmp_path):
    scores = made_scores.simple_rooms()
    items = {**scores.items, "view_angle_degrees": np.array([0, 35, -1, -1])}
    write_scores(replace(scores, items=items), tmp_path / "s.json")
    found = read_scores(tmp_path / "s.json").items["view_angle_degrees"]
    assert found.tolist() == [0, 35, -1, -1]
    below = {**items, "view_angle_degrees": np.array([0, 35, -2, -1])}
    with refused(JsonError, "items.view_angle_degrees[2]", found="-2"):
        write_scores(replace(scores, items=below), tmp_path / "s.json", overwrite=True)


def test_questions_are_read_back(tmp_path):
    scores = made_scores.iqtt_scores("m", [1, 0, 1, 1])
    write_scores(scores, tmp_path / "s.json")
    found = read_scores(tmp_path / "s.json")
    assert (found.task, found.by_distractor) == ("iqtt", scores.by_distractor)
    assert found.clusters.tolist() == [0, 1, 2, 3]
    several = made_scores.iqtt_scores("m", [1, 0, 1 / 3, 1], runs=3)
    write_scores(several, tmp_path / "s.json", overwrite=True)
    assert read_scores(tmp_path / "s.json").items["iqtt_accuracy"][2] == 1 / 3


def test_the_text_does_not_depend_on_the_order_of_anything(tmp_path):
    scores = made_scores.simple_rooms()
    turned = replace(
        scores,
        metrics=dict(reversed(scores.metrics.items())),
        items=dict(reversed(scores.items.items())),
        by_view_angle=dict(reversed(scores.by_view_angle.items())),
        meta=replace(scores.meta, versions=dict(reversed(scores.meta.versions.items()))),
    )
    text = to_json(scores)
    assert to_json(turned) == text
    content = json.loads(text)
    assert list(content)[:3] == ["format", "format_version", "task"]
    assert list(content["metrics"]) == ["chamfer", "hausdorff", "f_score_0.05", "mse_depth"]
    assert list(content["items"])[:4] == ["row", "scene_index", "view_index", "chamfer"]
    assert list(content["by_view_angle"]) == ["0", "5", "35"]
    assert text.count("\n") < 130  # columns take a line each


def test_numbers_that_are_not_finite_become_null(tmp_path):
    scores = made_scores.simple_rooms()
    odd = {"chamfer": Score(0.2, math.nan, math.inf, "scene unit", 2, -math.inf)}
    column = np.array([0.1, math.nan, math.inf, 0.2])
    found = to_json(replace(scores, metrics=odd, items={**scores.items, "rmse": column}))
    assert "NaN" not in found
    assert "Infinity" not in found
    content = json.loads(found)
    assert content["metrics"]["chamfer"]["low"] is content["metrics"]["chamfer"]["std"] is None
    assert content["items"]["rmse"] == [0.1, None, None, 0.2]
    write_scores(replace(scores, items={**scores.items, "rmse": column}), tmp_path / "s.json")
    assert np.isnan(read_scores(tmp_path / "s.json").items["rmse"]).tolist() == [0, 1, 1, 0]


def test_numpy_numbers_are_taken(tmp_path):
    scores = made_scores.simple_rooms()
    old = scores.metrics["chamfer"]
    odd = Score(
        np.float64(old.value), np.float32(0.0), np.float64(1.0), old.unit, np.int64(2), None
    )
    counts = {name: np.int64(number) for name, number in scores.meta.counts.items()}
    meta = replace(scores.meta, counts=counts)
    scores = replace(scores, comparable=np.bool_(True), metrics={"chamfer": odd}, meta=meta)
    write_scores(scores, tmp_path / "s.json")
    found = read_scores(tmp_path / "s.json")
    assert found.metrics["chamfer"] == Score(old.value, 0.0, 1.0, old.unit, 2, None)
    assert found.meta.counts == counts


def test_what_the_reader_would_refuse_is_not_written(tmp_path):
    scores = made_scores.simple_rooms()
    path = tmp_path / "s.json"
    path.write_text("before")
    wrong = {
        "a metric": replace(scores, metrics={"cd": scores.metrics["chamfer"]}),
        "a value": replace(
            scores, metrics={"chamfer": Score(9.0, None, None, "scene unit", 2, None)}
        ),
        "a name": replace(scores, method="\ud800"),
        "a task": replace(scores, task="room"),
        "no items": replace(scores, items={}),
        "a grouping": replace(scores, by_view_angle={"x": {}}),
    }
    for what, broken in wrong.items():
        with pytest.raises(JsonError) as caught:
            write_scores(broken, path, overwrite=True)
        assert caught.value.where.startswith(f"{path}"), what
        assert path.read_text() == "before", what
        assert os.listdir(tmp_path) == ["s.json"], what


def test_names_beyond_ascii_are_escaped(tmp_path):
    """One wide character would make the whole text take four times its memory when it is read."""
    path = tmp_path / "s.json"
    write_scores(made_scores.simple_rooms("Größe \U0001f600"), path)
    assert path.read_bytes().isascii()
    assert read_scores(path).method == "Größe \U0001f600"


def test_what_is_too_large_to_read_is_not_written(tmp_path, monkeypatch):
    scores = made_scores.simple_rooms()
    monkeypatch.setattr("metrics.score_file.MOST_BYTES", len(to_json(scores)) - 1)
    with refused(JsonError, "s.json", f"{len(to_json(scores))} bytes", hint="--csv"):
        write_scores(scores, tmp_path / "s.json")
    assert os.listdir(tmp_path) == []


def test_files_are_replaced_only_when_asked(tmp_path):
    scores, path = made_scores.simple_rooms(), tmp_path / "s.json"
    write_scores(scores, path)
    with pytest.raises(FileExistsError, match="--overwrite"):
        write_scores(made_scores.simple_rooms("other"), path)
    assert read_scores(path).method == "mine"
    write_scores(made_scores.simple_rooms("other"), path, overwrite=True)
    assert read_scores(path).method == "other"
    with pytest.raises(FileNotFoundError):
        read_scores(tmp_path / "none.json")
    with pytest.raises(IsADirectoryError):
        read_scores(tmp_path)


def test_huge_and_odd_files_are_not_read(tmp_path):
    path = tmp_path / "s.json"
    with path.open("wb") as file:
        file.truncate(2**40)
    with refused(JsonError, found=f"{2**40} bytes", expected=f"at most {2**28}"):
        read_scores(path)
    os.mkfifo(tmp_path / "fifo")
    with refused(JsonError, expected="a regular file"):
        read_scores(tmp_path / "fifo")
