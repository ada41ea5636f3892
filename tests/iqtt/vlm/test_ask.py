"""A model behind a server: replies are kept, faults are tried again, nothing is asked twice."""

import io
import json
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from chat_server import KEY, choice, completion, picture_of, serving
from PIL import Image

from iqtt.vlm.ask import AskError, Server, ask, read_heading, read_log, totals
from iqtt.vlm.rows import Asked, vlm_rows
from scenegen.common.errors import FileFormatError, SceneGenError, SpecError


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
        (200, b'{"choices": [...'), (200, b'{"error": {"message": "busy"}}'), (200, b"null"),
        choice({"message": {"content": ""}, "finish_reason": "error"}), choice({"message": None}),
        choice({"message": {"content": [7]}}),
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


HALF_AN_EMOJI = "The answer is B \ud83d"
THOUGHT = {"type": "thinking", "thinking": [{"type": "text", "text": "A?"}]}


@pytest.mark.parametrize(
    ("value", "letter", "outcome"),
    [
        ({"message": {"content": HALF_AN_EMOJI}}, "B", "answered"),
        ({"message": {"content": "B", "refusal": None}, "finish_reason": "stop"}, "B", "answered"),
        ({"message": {"content": [{"type": "text", "text": "B"}]}}, "B", "answered"),
        ({"message": {"content": [THOUGHT, {"type": "text", "text": "B"}]}}, "B", "answered"),
        ({"message": {"content": ["The answer is ", "B"]}}, "B", "answered"),
        ({"message": {"content": [{"type": "output_text", "text": "B"}]}}, "B", "answered"),
        ({"message": {"content": None, "refusal": "I can't."}}, None, "refused"),
        ({"message": {"content": [{"type": "refusal", "refusal": "No."}]}}, None, "refused"),
        ({"message": {"content": ""}, "finish_reason": "content_filter"}, None, "refused"),
        ({"message": {"content": "A, or"}, "finish_reason": "length"}, None, "cut off"),
        ({"message": {"content": ""}, "finish_reason": "length"}, None, "cut off"),
        ({"message": {"content": "<think>A."}, "finish_reason": "length"}, None, "cut off"),
        ({"message": {"content": "Answer: B. It"}, "finish_reason": "length"}, "B", "cut off"),
        ({"message": {"content": "A.", "reasoning": "B."}}, "A", "answered"),
        ({"message": {"content": "B"}, "finish_reason": "MAX_TOKENS"}, "B", "cut off"),
    ],
)  # fmt: skip
def test_every_form_of_a_reply_is_kept_and_read(
    asked: Asked, tmp_path: Path, value: dict[str, Any], letter: str | None, outcome: str
) -> None:
    few = replace(asked, items=[2, 3], rotations=1)
    with serving(lambda *_: choice(value)) as (server, bodies):
        replies = ask(few, server, tmp_path / "log.jsonl")
        assert ask(few, server, tmp_path / "log.jsonl") == replies
    assert [(reply["letter"], reply["outcome"]) for reply in replies] == [(letter, outcome)] * 2
    assert len(bodies) == 2
    assert read_log(tmp_path / "log.jsonl") == {reply["id"]: reply for reply in replies}


def test_what_was_cut_off_is_counted_and_so_are_thoughts_without_an_end(
    asked: Asked, tmp_path: Path
) -> None:
    texts = iter(["", "<think>A", "It is B or", "The answer is B. Its", "C", "none"])
    ends = iter(["length"] * 4 + ["stop"] * 2)

    def reply(*_: Any) -> tuple[int, bytes]:
        return choice({"message": {"content": next(texts)}, "finish_reason": next(ends)})

    with serving(reply) as (server, _):
        one_by_one = replace(server, concurrency=1)
        sums = totals(ask(replace(asked, rotations=1), one_by_one, tmp_path / "log.jsonl"))
    assert (sums.rows, sums.cut_off, sums.only_thoughts) == (6, 4, 2)
    assert (sums.answered, sums.unparsed, sums.unread) == (1, 1, 4)


REFUSALS = {
    "max_tokens": "Unsupported parameter: 'max_tokens'. Use 'max_completion_tokens' instead.",
    "temperature": "Unsupported value: 'temperature' does not support 0. Only 1 is supported.",
}


@pytest.mark.parametrize("refused", [["max_tokens"], ["temperature"], list(REFUSALS)])
@pytest.mark.parametrize("status", [400, 422])
def test_a_server_gets_the_settings_that_it_takes(
    asked: Asked, tmp_path: Path, refused: list[str], status: int
) -> None:
    def reply(body: dict[str, Any], _: int) -> tuple[int, bytes]:
        wrong = next((name for name in refused if name in body), None)
        if wrong:
            return status, json.dumps({"error": {"message": REFUSALS[wrong]}}).encode()
        return completion("B")

    with serving(reply) as (server, bodies):
        replies = ask(replace(asked, rotations=1), server, tmp_path / "log.jsonl")
    limit = "max_completion_tokens" if "max_tokens" in refused else "max_tokens"
    expected = {limit: 1024} | ({} if "temperature" in refused else {"temperature": 0.0})
    assert [reply["settings"] for reply in replies] == [expected] * 6
    assert len(bodies) < 6 + 2 * 2 * 2  # each thread learns it once


@pytest.mark.parametrize(
    "text",
    ["temperature must be between 0 and 1", "this model is not for you", "max_tokens is too large"],
)
def test_a_setting_out_of_range_is_an_error(asked: Asked, tmp_path: Path, text: str) -> None:
    with serving(lambda *_: (400, text.encode())) as (server, _), pytest.raises(AskError) as info:
        ask(replace(asked, items=[0], rotations=1), server, tmp_path / "log.jsonl")
    assert text in info.value.found


def test_one_process_at_a_time_writes_to_a_log(asked: Asked, tmp_path: Path) -> None:
    log, started, end = tmp_path / "log.jsonl", threading.Event(), threading.Event()

    def reply(*_: Any) -> tuple[int, bytes]:
        started.set()
        end.wait(10)
        return completion("B")

    few = replace(asked, items=[0], rotations=1)
    with serving(reply) as (server, _):
        patient = replace(server, timeout=20)
        first = threading.Thread(target=ask, args=(few, patient, log))
        first.start()
        started.wait(10)
        with pytest.raises(SceneGenError):
            ask(few, patient, log)
        end.set()
        first.join()
        assert len(ask(few, patient, log)) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["log.jsonl"]


def test_a_log_of_two_writers_is_read_and_the_first_reply_counts(
    asked: Asked, tmp_path: Path
) -> None:
    log, few = tmp_path / "log.jsonl", replace(asked, rotations=1)
    with serving(lambda *_: completion("B")) as (server, bodies):
        replies = ask(few, server, log)
        heading, *lines = log.read_bytes().splitlines(keepends=True)
        log.write_bytes(b"".join([heading, *lines[:4], heading, *lines[1:3], *lines[4:]]))
        assert ask(few, server, log) == replies
        log.write_bytes(log.read_bytes() + lines[2].replace(b'"letter": "B"', b'"letter": "C"'))
        with pytest.warns(UserWarning, match="1 rows"):
            assert ask(few, server, log) == replies
        assert len(bodies) == 6
        other = heading.replace(b'"tiny"', b'"other"')
        log.write_bytes(b"".join([heading, *lines, other]))
        with pytest.raises(FileFormatError):
            ask(few, server, log)
