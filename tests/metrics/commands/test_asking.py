"""`bench ask`: Inspect asks a server, keeps what came, and asks again what failed."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from chat_server import KEY, completion, picture_of, serving

from iqtt.vlm.rows import Asked, vlm_rows
from metrics.intake.harness_logs import read_returned
from metrics.scoring.evaluate import score
from metrics.scoring.runs import Settings
from metrics.submissions.reader import open_predictions

pytest.importorskip("inspect_ai")
pytest.importorskip("openai")
ASK = [sys.executable, "-c", "import cli; cli.bench()", "ask"]


def ask(folder: Path, *words: object, key: str = KEY) -> tuple[int, str]:
    """Run the command in a folder, as users do; return its status and its last line."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    for name in ("OPENAI_API_KEY", "LOCAL_API_KEY"):
        environment.pop(name, None)
    done = subprocess.run(
        [*ASK, *map(str, words)], cwd=folder, capture_output=True, text=True, check=False,
        env=environment | ({"LOCAL_API_KEY": key} if key else {}),
    )  # fmt: skip
    assert "Traceback" not in done.stderr, done.stderr
    return done.returncode, (done.stdout + done.stderr).splitlines()[-1]


def test_a_server_is_asked_and_what_failed_is_asked_again(quiz_split: Path, tmp_path: Path) -> None:
    key = quiz_split / "iqtt-test-answers.h5"
    asked = Asked(quiz_split / "iqtt-test.h5", rotations=3, size=64, items=[0, 1, 5],
                  with_answers=True)  # fmt: skip
    rows = {row.image: row for row in vlm_rows(asked)}
    failing = {"1-0", "5-2"}

    def reply(body: dict[str, Any], _: int) -> tuple[int, bytes]:
        row = rows[picture_of(body)]
        assert (body["temperature"], body["max_tokens"]) == (0.0, 1024)
        if row.id in failing:
            return 400, b'{"error": {"message": "out of order"}}'
        return completion(row.answer if row.question_index else "None of them.")

    with serving(reply) as (url, bodies):
        how = ("--model", "openai-api/local/tiny", "--base-url", url, "--rotations", 3,
               "--size", 64, "--items", "0,1,5", "--tries", 1, "--out", "p.h5")  # fmt: skip
        assert ask(tmp_path, asked.path, *how)[0] == 0
        (log,) = (tmp_path / "logs").glob("*.eval")
        assert set(read_returned(log).failures) == {(1, 0), (5, 2)}
        with open_predictions(tmp_path / "p.h5") as opened:
            assert (opened.method, opened.rows.tolist()) == ("openai-api/local/tiny", [0, 5])
        assert len(bodies) == 9
        failing.clear()
        assert ask(tmp_path, asked.path, *how)[0] == 2  # p.h5 is there
        assert ask(tmp_path, asked.path, *how, "--overwrite")[0] == 0
        assert len(bodies) == 9 + 2
    scores = score([tmp_path / "p.h5"], key, Settings(allow_partial=True))
    assert scores.metrics["iqtt_accuracy"].value == pytest.approx(2 / 3)
    assert scores.answer_groups["by_outcome"]["unparsed"].n == 1
    assert scores.by_circle["every order"]["iqtt_accuracy"].n == 3
    (log,) = (tmp_path / "logs").glob("*.eval")
    assert read_returned(log).tokens == (90, 18)
    assert KEY.encode() not in log.read_bytes()


@pytest.mark.slow
def test_what_cannot_be_asked_is_one_line(quiz_split: Path, tmp_path: Path) -> None:
    test = quiz_split / "iqtt-test.h5"
    how = ("--out", "p.h5", "--items", 0, "--size", 64, "--tries", 1)
    for model, *more in (
        ("nobody/tiny",), ("tiny",), ("openai/tiny",), ("openai-api/local/tiny",),
        ("openai-api/local/tiny", "--base-url", "http://127.0.0.1:9/v1"),
    ):  # fmt: skip
        key = KEY if more else ""
        code, line = ask(tmp_path, test, "--model", model, *more, *how, key=key)
        assert (code, line.startswith("Error: ")) == (2, True), line
    assert not (tmp_path / "p.h5").exists()
