"""Ask a server that speaks OpenAI's chat protocol (vLLM, llama.cpp, Ollama), row by row.

Each reply is written to a log, and to the disk, before the row counts as asked. So a run that is
stopped goes on where it was, and asks no row twice. The log never holds the key. One process at a
time writes to a log.
"""

import base64
import json
import os
import random
import re
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from iqtt.vlm.reading import ENDINGS, Outcome, is_thought_alone, read_reply
from iqtt.vlm.rows import Asked, Row, vlm_rows
from scenegen.common.errors import FileFormatError, SceneGenError, SpecError
from scenegen.files.sets.workspace import run_lock

FORMAT = "pix2shape-bench/asked"
NEEDED = frozenset({"id", "question_index", "rotation", "answer", "letter", "outcome", "text"})
RETRIED = frozenset({408, 409, 425, 429, 500, 502, 503, 504, 529})  # HTTP statuses that may pass
REFUSING = frozenset({400, 422})  # HTTP statuses of a server that does not take a setting
OTHER_NAME = re.compile("max_completion_tokens|max_tokens.{0,40}(?:support|deprecat|permit)")
LONGEST_WAIT = 60.0  # seconds between two tries

_ADAPTING = threading.Lock()


class AskError(SceneGenError):
    """The server gave no usable reply."""


@dataclass(frozen=True)
class Server:
    """A model behind a server, and how it is asked.

    Attributes:
        model: name that the server knows.
        base_url: such as "http://127.0.0.1:8000/v1".
        key: for the header; it is never written. Empty for servers that ask for none.
        temperature, max_tokens: of the reply.
        timeout: seconds that a reply may take.
        tries: most requests for one row.
        concurrency: requests at the same time.
        pause: seconds before the second try; each further pause is twice as long.
    """

    model: str
    base_url: str
    key: str = ""
    temperature: float = 0.0
    max_tokens: int = 1024
    timeout: float = 120.0
    tries: int = 6
    concurrency: int = 4
    pause: float = 1.0


@dataclass(frozen=True)
class Totals:
    """What a log of replies holds.

    Attributes:
        rows: that have a reply.
        answered, unparsed, refused, cut_off: their outcomes.
        unread: rows without a letter, whatever their outcome.
        only_thoughts: rows that were cut off before the model had ended its thoughts.
        right: rows with the right letter, of those whose answer is known; `known` counts these.
        input_tokens, output_tokens: as the server tells them.
    """

    rows: int
    answered: int
    unparsed: int
    refused: int
    cut_off: int
    unread: int
    only_thoughts: int
    right: int
    known: int
    input_tokens: int
    output_tokens: int


def ask(
    asked: Asked,
    server: Server,
    log: str | Path,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[dict[str, Any]]:
    """Ask all rows that the log does not hold yet; return all lines of the log, by row.

    Args:
        log: JSON Lines: a heading, then one object a reply. It is made, or continued.
        progress: is told how many rows have a reply, once at the start and then as they come.

    Raises:
        AskError: a row got no usable reply after all tries. What came before is in the log.
        SpecError: the log is of other questions or settings.
        SceneGenError: another process writes to the log.
        FileFormatError: the log is damaged.
        OSError, SpecError, FileFormatError: as `vlm_rows`.
    """
    import httpx

    path = Path(log)
    rows = vlm_rows(asked)
    first = next(rows, None)
    if first is None:
        raise SpecError(asked.path, "no questions", "at least one")
    heading = _heading(asked, server, first)
    headers = {"Authorization": f"Bearer {server.key}"} if server.key else {}
    settings = {"temperature": server.temperature, "max_tokens": server.max_tokens}
    with run_lock(Path(f"{path}.lock"), path):
        replies = read_log(path, heading) if path.exists() else {}
        progress(len(replies))
        with (
            _appending(path, heading) as file,
            httpx.Client(timeout=server.timeout, headers=headers) as client,
            ThreadPoolExecutor(server.concurrency) as pool,
        ):
            waiting: set[Future[dict[str, Any]]] = set()
            stop = threading.Event()  # ends pauses between tries
            try:
                for row in _chained(first, rows):
                    if row.id in replies:
                        continue
                    waiting.add(pool.submit(_ask_row, client, server, settings, row, stop))
                    if len(waiting) >= 2 * server.concurrency:
                        waiting = _keep(waiting, file, replies, progress)
                while waiting:
                    waiting = _keep(waiting, file, replies, progress)
            except BaseException:
                stop.set()
                for future in waiting:
                    future.cancel()
                for future in waiting:  # replies that were paid for are kept
                    with suppress(BaseException):
                        _write(file, future.result(), replies)
                raise
    return [replies[name] for name in sorted(replies, key=_order)]


def totals(replies: list[dict[str, Any]]) -> Totals:
    """Return the sums of a log's lines."""
    outcomes = [reply["outcome"] for reply in replies]
    known = [reply for reply in replies if reply["right"] is not None]
    return Totals(
        rows=len(replies),
        answered=outcomes.count("answered"),
        unparsed=outcomes.count("unparsed"),
        refused=outcomes.count("refused"),
        cut_off=outcomes.count("cut off"),
        unread=sum(reply["letter"] is None for reply in replies),
        only_thoughts=sum(
            reply["outcome"] == "cut off" and is_thought_alone(reply["text"]) for reply in replies
        ),
        right=sum(reply["right"] for reply in known),
        known=len(known),
        input_tokens=sum(reply["input_tokens"] for reply in replies),
        output_tokens=sum(reply["output_tokens"] for reply in replies),
    )


def read_log(path: str | Path, heading: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the replies of a log by the id of their row. A last line that is cut off is left out.

    Where two processes wrote to a log, the first reply to a row counts.

    Args:
        heading: that the log must have.

    Raises OSError; FileFormatError for a damaged log; SpecError for one with another heading.
    """
    *lines, _ = Path(path).read_bytes().split(b"\n")
    values = [_line(path, number, line) for number, line in enumerate(lines, 1)]
    if not values or values[0].get("format") != FORMAT:
        raise FileFormatError(path, "no log of bench ask", "one, or a new name")
    for name, value in (heading or {}).items():
        if values[0].get(name) != value:
            place = f"{path}: {name}"
            raise SpecError(place, values[0].get(name), f"{value}, or a new name for the log")
    replies: dict[str, Any] = {}
    other = 0
    for number, value in enumerate(values[1:], 2):
        if "format" in value:  # two processes began the log
            if value != values[0]:
                raise FileFormatError(f"{path}: line {number}", "a second heading", "one")
        elif replies.setdefault(value["id"], value) != value:
            other += 1
    if other:
        text = f"{path}: {other} rows were asked twice; the first reply to each counts"
        warnings.warn(text, stacklevel=2)
    return replies


def read_heading(path: str | Path) -> dict[str, Any]:
    """Return the heading of a log: model, settings, digest of the questions."""
    with Path(path).open("rb") as file:
        return _line(path, 1, file.readline())


def _line(path: str | Path, number: int, line: bytes) -> dict[str, Any]:
    try:
        value = json.loads(line)
    except ValueError:
        value = None
    if not isinstance(value, dict) or not ("format" in value or value.keys() >= NEEDED):
        raise FileFormatError(f"{path}: line {number}", "no reply", "a reply with its id")
    return value


def _heading(asked: Asked, server: Server, first: Row) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "model": server.model,
        "temperature": server.temperature,
        "max_tokens": server.max_tokens,
        "layout": asked.layout,
        "rotations": asked.rotations,
        "size": asked.size,
        "control": not asked.with_reference,
        "digest": first.digest,
        "prompt": first.question,
    }


@contextmanager
def _appending(path: Path, heading: Mapping[str, Any]) -> Iterator[TextIO]:
    """Open a log to append whole lines; a last line that is cut off is removed."""
    new = not path.exists()
    if not new:
        os.truncate(path, path.read_bytes().rfind(b"\n") + 1)
    # A reply may hold half an emoji, a surrogate, which becomes the escape that JSON has for it.
    with path.open("a", encoding="utf-8", errors="backslashreplace") as file:
        if new:
            _append(file, heading)
        yield file


def _append(file: TextIO, value: Mapping[str, Any]) -> None:
    file.write(json.dumps(value, ensure_ascii=False) + "\n")
    file.flush()
    os.fsync(file.fileno())


def _write(file: TextIO, reply: dict[str, Any], replies: dict[str, Any]) -> None:
    if reply["id"] not in replies:
        _append(file, reply)
        replies[reply["id"]] = reply


def _keep(
    waiting: set[Future[dict[str, Any]]],
    file: TextIO,
    replies: dict[str, Any],
    progress: Callable[[int], Any],
) -> set[Future[dict[str, Any]]]:
    """Write the replies that have come; return the requests that still wait."""
    done, still = wait(waiting, return_when=FIRST_COMPLETED)
    failed = None
    for future in done:
        error = future.exception()
        if error is None:
            _write(file, future.result(), replies)
            progress(1)
        failed = failed or error
    if failed is not None:
        waiting.difference_update(done)
        raise failed
    return still


def _ask_row(
    client: Any, server: Server, settings: dict[str, Any], row: Row, stop: threading.Event
) -> dict[str, Any]:
    """Return the line of the log for a row. Raises AskError after the last try.

    Args:
        settings: temperature and limit, under the names that the server takes; they are changed
            for all rows where it does not take one.
    """
    started, rng = time.monotonic(), random.Random(row.id)
    url = server.base_url.rstrip("/") + "/chat/completions"
    problem, pause = "", server.pause
    for number in range(1, server.tries + 1):
        sent = dict(settings)
        problem, later, reply = _one_try(client, url, _body(server, row) | sent)
        while reply is None and later is None and _adapt(settings, sent, problem):
            sent = dict(settings)
            problem, later, reply = _one_try(client, url, _body(server, row) | sent)
        if reply is not None:
            return _reply(row, reply, sent, number, time.monotonic() - started)
        if later is None:
            break
        if number < server.tries:
            if stop.wait(min(LONGEST_WAIT, max(later, pause * rng.uniform(1.0, 1.5)))):
                break
            pause *= 2
    place = f"{server.base_url}: row {row.id}"
    raise AskError(place, problem, "a chat completion", "run the same command to go on")


def _one_try(
    client: Any, url: str, body: dict[str, Any]
) -> tuple[str, float | None, dict[str, Any] | None]:
    """Return the problem, how many seconds to wait before a new try (None: no use), the reply."""
    import httpx

    try:
        response = client.post(url, json=body)
    except httpx.HTTPError as error:
        return f"{type(error).__name__} {error}".strip(), 0.0, None
    if response.status_code != 200:
        text = f"status {response.status_code}: {response.text[:400]}"
        if response.status_code not in RETRIED:
            return text, None, None
        return text, _seconds(response.headers.get("retry-after", "0")), None
    try:
        return "", 0.0, _message(response.json())
    except AskError as error:
        problem = error.found
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        problem = f"no chat completion: {response.text[:100]!r}"
    return problem, 0.0, None


def _message(value: Any) -> dict[str, Any]:
    """Return text, refusal, ending and usage of a chat completion.

    Raises AskError for a reply that failed, and what Python raises for what is no completion.
    """
    choice = value["choices"][0]
    message, ending = choice["message"], str(choice.get("finish_reason") or "").lower()
    if choice.get("error") or ending in ("error", "abort"):
        raise AskError("", f"a reply that failed: {(choice.get('error') or ending)!a:.200}")
    if not (message.keys() & {"content", "refusal"} or ending):
        raise LookupError("content")
    parts, usage = list(_parts(message.get("content"))), value.get("usage")
    return {
        "text": "".join(text for kind, text in parts if kind == "text"),
        "refusal": str(message.get("refusal") or "")
        + "".join(text for kind, text in parts if kind == "refusal"),
        "ending": ending,
        "usage": usage if isinstance(usage, dict) else {},
    }


def _parts(content: Any) -> Iterator[tuple[str, str]]:
    """Yield kind, "text" or "refusal", and text of the parts of a message, without its thoughts."""
    if isinstance(content, str):
        yield "text", content
    elif isinstance(content, list):
        for part in content:
            yield from _parts(part)
    elif isinstance(content, dict):
        kind = content.get("type")
        if kind == "refusal":
            yield "refusal", str(content.get("refusal"))
        elif kind not in ("thinking", "reasoning"):
            yield from _parts(content.get("text"))
    elif content is not None:
        raise AskError("", "a message that is no text")


def _adapt(settings: dict[str, Any], sent: Mapping[str, Any], problem: str) -> bool:
    """Change the settings of all rows to what a server's refusal asks for; return whether to retry.

    Models that think want `max_completion_tokens` in place of `max_tokens`, and may have one
    temperature, which is then left to them. A number out of range is not changed.
    """
    if not problem.startswith(tuple(f"status {status}" for status in REFUSING)):
        return False
    outside = re.search(r"(?i)between|less than|greater|at most|maximum|range|<=|≤", problem)
    with _ADAPTING:
        if settings != sent:  # another row's refusal has changed them since
            return True
        if "max_tokens" in settings and OTHER_NAME.search(problem):
            settings["max_completion_tokens"] = settings.pop("max_tokens")
            return True
        if "temperature" in settings and "temperature" in problem and not outside:
            del settings["temperature"]
            return True
    return False


def _seconds(text: str) -> float:
    try:
        return max(0.0, float(text))
    except ValueError:  # a date
        return 0.0


def _body(server: Server, row: Row) -> dict[str, Any]:
    content: list[dict[str, Any]] = [
        {"type": "image_url", "image_url": {"url": _data_url(picture)}} for picture in row.sent
    ]
    content.append({"type": "text", "text": row.question})
    return {
        "model": server.model,
        "messages": [{"role": "user", "content": content}],
    }


def _data_url(png: bytes) -> str:
    return "data:image/png;base64," + base64.b64encode(png).decode()


def _reply(
    row: Row, reply: Mapping[str, Any], sent: Mapping[str, Any], tries: int, seconds: float
) -> dict[str, Any]:
    text = reply["text"] or reply["refusal"]
    outcome: Outcome | None = "refused" if reply["refusal"] else ENDINGS.get(reply["ending"])
    reading = read_reply(reply["text"], len(row.letters), outcome)
    letter = None if reading.answer is None else row.letters[reading.answer]
    tokens = [reply["usage"].get(name) for name in ("prompt_tokens", "completion_tokens")]
    counted = [count if isinstance(count, int) else 0 for count in tokens]
    return {
        "id": row.id,
        "question_index": row.question_index,
        "rotation": row.rotation,
        "letter": letter,
        "outcome": reading.outcome,
        "answer": None if reading.answer is None else row.original(reading.answer),
        "right": None if row.answer is None else letter == row.answer,
        "text": text,
        "finish_reason": reply["ending"],
        "settings": dict(sent),
        "input_tokens": counted[0],
        "output_tokens": counted[1],
        "tries": tries,
        "seconds": round(seconds, 3),
    }


def _chained(first: Row, rows: Iterator[Row]) -> Iterator[Row]:
    yield first
    yield from rows


def _order(name: str) -> tuple[int, ...]:
    return tuple(int(number) for number in name.split("-"))
