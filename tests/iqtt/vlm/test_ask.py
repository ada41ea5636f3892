"""A model behind a server: replies are kept, faults are tried again, nothing is asked twice."""

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from chat_server import KEY, completion, picture_of, serving
from PIL import Image

from iqtt.vlm.ask import AskError, Server, ask, read_heading, totals
from iqtt.vlm.rows import Asked, vlm_rows
from scenegen.common.errors import FileFormatError, SpecError


def right_letters(asked: Asked) -> dict[bytes, str]:
    return {row.image: row.answer or "" for row in vlm_rows(asked)}


def test_right_letters_in_every_order_are_right_answers(asked: Asked, tmp_path: Path) -> None:
    letters = right_letters(asked)

    def reply(body: dict[str, Any], _: int) -> tuple[int, bytes]:
        Image.open(io.BytesIO(picture_of(body))).verify()
        text = f"The answer is {letters[picture_of(body)]}."
        return completion(text, prompt_tokens=10, completion_tokens=2)

    with serving(reply) as (server, bodies):
        replies = ask(asked, server, tmp_path / "log.jsonl")
    sums = totals(replies)
    assert (sums.rows, sums.right, sums.known, sums.answered) == (18, 18, 18, 18)
    assert (sums.input_tokens, sums.output_tokens) == (180, 36)
    assert len(bodies) == 18
    assert {body["temperature"] for body in bodies} == {0.0}
    assert KEY not in (tmp_path / "log.jsonl").read_text()
    assert read_heading(tmp_path / "log.jsonl")["model"] == "tiny"


@pytest.mark.parametrize(
    "fault",
    [
        (429, b"{}"), (500, b"oops"), (503, b""), (200, b"no json"), (200, b"{}"),
        (200, b'{"choices": []}'), (200, b'{"choices": [{"message": {"content": 7}}]}'),
        (200, b'{"choices": [...'),
    ],
)  # fmt: skip
def test_faults_that_may_pass_are_tried_again(
    asked: Asked, tmp_path: Path, fault: tuple[int, bytes]
) -> None:
    few = replace(asked, items=[2], rotations=1)
    with serving(lambda _, times: completion("B") if times == 2 else fault) as (server, bodies):
        (reply,) = ask(few, server, tmp_path / "log.jsonl")
    assert (reply["letter"], reply["tries"], len(bodies)) == ("B", 3, 3)


def test_a_run_goes_on_and_asks_nothing_twice(asked: Asked, tmp_path: Path) -> None:
    log = tmp_path / "log.jsonl"
    few = replace(asked, rotations=1)
    answered: list[str] = []

    def reply(body: dict[str, Any], times: int) -> tuple[int, bytes]:
        if len(answered) < 3:
            answered.append("x")
            return completion("none of them")
        return 400, b'{"error": "enough"}'

    with serving(reply) as (server, _):
        with pytest.raises(AskError):
            ask(few, replace(server, concurrency=1), log)
        kept = log.read_bytes()
        assert len(kept.splitlines()) == 1 + 3
        log.write_bytes(kept + b'{"id": "5-0", "te')  # killed while it wrote
    with serving(lambda *_: completion("A")) as (server, bodies):
        replies = ask(few, server, log)
        assert len(bodies) == 3
        assert ask(few, server, log) == replies
        assert len(bodies) == 3
        with pytest.raises(SpecError):
            ask(few, replace(server, model="other"), log)
    assert [reply["outcome"] for reply in replies].count("answered") == 3
    assert log.read_bytes().startswith(kept)
    log.write_bytes(kept.splitlines(keepends=True)[1] * 2)
    with pytest.raises(FileFormatError):
        ask(few, server, log)


def test_a_silent_server_is_an_error_and_no_traceback_of_a_library(
    asked: Asked, tmp_path: Path
) -> None:
    server = Server("tiny", "http://127.0.0.1:9/v1", timeout=0.5, tries=2, pause=0.01)
    with pytest.raises(AskError):
        ask(replace(asked, items=[0]), server, tmp_path / "log.jsonl")
