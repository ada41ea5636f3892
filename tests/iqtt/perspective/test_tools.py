"""The tools of questions on a split about rooms: they take it as any other file of questions."""

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner
from perspective_splits import SETTINGS

import cli
from iqtt import QuestionStream
from iqtt.files.reader import QuestionsFile
from iqtt.floors import Floor, Measured, settings_of, to_json
from iqtt.perspective.specs import perspective_spec
from iqtt.questions.kinds import ROOM_KINDS
from iqtt.vlm.rows import Asked, vlm_rows


def ran(group, *words):
    done = CliRunner().invoke(getattr(cli, group), [str(word) for word in words])
    assert done.exit_code == 0, done.output
    return done.output


@pytest.mark.parametrize("name", ["iqtt-val.h5", "iqtt-test.h5"])
def test_the_oracle_is_scored_by_type_and_angle(rooms_folder, tmp_path, name):
    scores = tmp_path / "scores.json"
    ran("bench", "baseline", "oracle-warp", "--data", rooms_folder / name,
        "--out", tmp_path / "o.h5")  # fmt: skip
    truth = rooms_folder / name.replace("test", "test-answers")
    with QuestionsFile(rooms_folder / name) as table:
        settings = settings_of(table.spec)
    floors = tmp_path / "floors.json"
    known = tuple(Floor(kind, "same place, nearest", 0.5, 100) for kind in ROOM_KINDS)
    floors.write_text(to_json([Measured(settings, known)]))
    ran("bench", "score", tmp_path / "o.h5", "--truth", truth, "--json", scores,
        "--baselines", floors)  # fmt: skip
    record = json.loads(scores.read_text())
    groups = record["answer_groups"]
    assert set(groups["by_distractor"]) <= {"moved", "turned"}
    assert set(groups["by_rotation_angle"]) <= {"20-40", "40-60"}
    assert {f["kind"] for f in record["meta"]["question_floors"]} == set(groups["by_distractor"])


def test_baselines_of_shapes_are_refused(rooms_folder, tmp_path):
    words = ["baseline", "cubes", "--data", rooms_folder / "iqtt-val.h5", "--out", tmp_path / "c"]
    done = CliRunner().invoke(cli.bench, [str(word) for word in words])
    assert done.exit_code == 2
    assert list(tmp_path.iterdir()) == []


def test_rows_for_models_ask_about_rooms(rooms_folder):
    rows = list(vlm_rows(Asked(rooms_folder / "iqtt-val.h5", rotations=3)))
    assert len(rows) == 6
    assert "same room" in rows[0].question
    assert rows[0].facts["cubes"] is None
    assert rows[0].facts["kind"] in ("moved", "turned")
    assert len({row.facts["shape"] for row in rows}) == 2
    with QuestionsFile(rooms_folder / "iqtt-val.h5") as table:  # sRGB as it is stored
        np.testing.assert_array_equal(rows[0].pictures, table.read("questions", 0))


def test_the_quiz_is_about_rooms(rooms_folder, tmp_path):
    page = tmp_path / "quiz.html"
    ran("iqtt", "quiz", rooms_folder / "iqtt-test.h5", "--questions", 2, "--practice", 1,
        "--out", page)  # fmt: skip
    content = re.search(r'id="quiz">(.*?)</script>', page.read_text())
    assert content
    assert json.loads(content[1])["about"] == "rooms"


def test_a_stream_has_the_rows_of_the_file(rooms_folder):
    spec = perspective_spec("perspective", train=2, val=2, test=3, **SETTINGS, with_depth=True)
    fields = ("questions", "answers", "depth")
    (batch,) = QuestionStream(spec, fields=fields, batch=2, stop=2, split="val")
    with QuestionsFile(rooms_folder / "iqtt-val.h5") as table:
        for name in fields:
            np.testing.assert_array_equal(batch[name], table.read(name, slice(None)))


def test_card_and_sheet_and_description(rooms_folder, tmp_path):
    ran("iqtt", "card", rooms_folder, "--creator", "A", "--out", tmp_path / "README.md")
    assert "furnished rooms" in (tmp_path / "README.md").read_text()
    ran("iqtt", "show", rooms_folder / "iqtt-val.h5", "--mark-correct", "--out", tmp_path / "q.png")
    assert "interiors" in ran("iqtt", "info", rooms_folder / "iqtt-val.h5")
    ran("iqtt", "export", rooms_folder / "iqtt-val.h5", "--format", "parquet", "--out",
        tmp_path / "rows")  # fmt: skip
