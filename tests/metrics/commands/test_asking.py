"""`bench ask`: Inspect asks a server, keeps what came, and asks again what failed."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from chat_server import KEY, completion, picture_of, serving
from click.testing import CliRunner

import cli
from iqtt.vlm.rows import Asked, vlm_rows
from metrics.intake.answers.harness_logs import read_returned
from metrics.scoring.evaluate import score
from metrics.scoring.runs import Settings
from metrics.submissions.reader import open_predictions

pytest.importorskip("inspect_ai")
pytest.importorskip("openai")
pytestmark = pytest.mark.filterwarnings("default")  # of what Inspect imports


@pytest.fixture
def bench_ask(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[int, str]]:
    """Return a function that runs `bench ask` here and returns its status and its last line."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    monkeypatch.setenv("LOCAL_API_KEY", KEY)

    def run(*words: object) -> tuple[int, str]:
        result = CliRunner().invoke(cli.bench, ["ask", *map(str, words)])
        assert result.exception is None or isinstance(result.exception, SystemExit)
        return result.exit_code, result.output.splitlines()[-1]

    return run


def test_a_server_is_asked_and_what_failed_is_asked_again(
    quiz_split: Path, tmp_path: Path, bench_ask: Callable[..., tuple[int, str]]
) -> None:
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
        assert bench_ask(asked.path, *how)[0] == 0
        (log,) = (tmp_path / "logs").glob("*.eval")
        assert set(read_returned(log).failures) == {(1, 0), (5, 2)}
        with open_predictions(tmp_path / "p.h5") as opened:
            assert (opened.method, opened.rows.tolist()) == ("openai-api/local/tiny", [0, 5])
        assert len(bodies) == 9
        failing.clear()
        assert bench_ask(asked.path, *how)[0] == 2  # p.h5 is there
        assert bench_ask(asked.path, *how, "--overwrite")[0] == 0
        assert len(bodies) == 9 + 2
    scores = score([tmp_path / "p.h5"], key, Settings(allow_partial=True))
    assert scores.metrics["iqtt_accuracy"].value == pytest.approx(2 / 3)
    assert scores.answer_groups["by_outcome"]["unparsed"].n == 1
    assert scores.by_circle["every order"]["iqtt_accuracy"].n == 3
    (log,) = (tmp_path / "logs").glob("*.eval")
    assert read_returned(log).tokens == (90, 18)
    assert KEY.encode() not in log.read_bytes()


@pytest.mark.parametrize(
    "model",
    [
        ["nobody/tiny"], ["tiny"], ["openai/tiny"], ["openai-api/other/tiny"],
        pytest.param(
            ["openai-api/local/tiny", "--base-url", "http://127.0.0.1:9/v1"],
            marks=pytest.mark.slow,
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_asked_is_one_line(
    quiz_split: Path, tmp_path: Path, bench_ask: Callable[..., tuple[int, str]], model: list[str]
) -> None:
    """No such provider, no provider, no key, no key, no server."""
    how = ("--out", "p.h5", "--items", 0, "--size", 64, "--tries", 1)
    code, line = bench_ask(quiz_split / "iqtt-test.h5", "--model", *model, *how)
    assert (code, line.startswith("Error: ")) == (2, True), line
    assert not (tmp_path / "p.h5").exists()
