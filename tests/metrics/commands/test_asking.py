"""`bench ask`: Inspect asks a server, keeps what came, and asks again what failed."""

import base64
import gc
import json
import threading
import warnings
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from click.testing import CliRunner

import cli
from iqtt.vlm.rows import Asked, vlm_rows
from metrics.intake.answers.harness_logs import read_returned
from metrics.scoring.evaluate import score
from metrics.scoring.runs import Settings
from metrics.submissions.reader import open_predictions

pytest.importorskip("inspect_ai")
pytest.importorskip("openai")
from inspect_ai.log import EvalSampleLimit, ProvenanceData, read_eval_log, write_eval_log

pytestmark = pytest.mark.filterwarnings("default")  # of what Inspect imports
KEY = "sk-secret-of-this-test"


@pytest.fixture(autouse=True)
def _streams_of_inspect():
    """Collect the streams that Inspect leaves open here, or another test fails on them."""
    yield
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)
        gc.collect()


def completion(text):
    """A reply, of two tokens to a prompt of ten."""
    choice = {"index": 0, "message": {"role": "assistant", "content": text}}
    usage = {"prompt_tokens": 10, "completion_tokens": 2, "total_tokens": 12}
    content = {"id": "1", "object": "chat.completion", "created": 0, "model": "tiny"}
    return {**content, "usage": usage, "choices": [{**choice, "finish_reason": "stop"}]}


@contextmanager
def serving(reply):
    """Serve status and content that `reply` returns for a body; give the address, and bodies."""
    bodies = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            assert self.headers["Authorization"] == f"Bearer {KEY}"
            body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            bodies.append(body)
            status, content = reply(body)
            answer = json.dumps(content).encode()
            self.send_response(status)
            self.send_header("Retry-After", "0")
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(answer)))
            self.end_headers()
            self.wfile.write(answer)

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/v1", bodies
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def picture_of(body):
    """The first picture of a request, as a PNG file."""
    (message,) = body["messages"]
    (url,) = [part["image_url"]["url"] for part in message["content"] if "image_url" in part]
    return base64.b64decode(url.split(",")[1])


@pytest.fixture
def bench_ask(tmp_path, monkeypatch):
    """Return a function that runs `bench ask` here and returns its status and its last line."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    monkeypatch.setenv("LOCAL_API_KEY", KEY)

    def run(*words):
        result = CliRunner().invoke(cli.bench, ["ask", *map(str, words)])
        assert result.exception is None or isinstance(result.exception, SystemExit)
        return result.exit_code, result.output.splitlines()[-1]

    return run


def test_a_server_is_asked_and_what_failed_is_asked_again(quiz_split, tmp_path, bench_ask):
    asked = Asked(quiz_split / "iqtt-val.h5", rotations=3, size=64, items=[0, 1, 2])
    rows = {row.image: row for row in vlm_rows(asked)}
    failing = {"1-0", "2-2"}

    def reply(body):
        row = rows[picture_of(body)]
        assert (body["temperature"], body["max_tokens"]) == (0.0, 1024)
        if row.id in failing:
            return 400, {"error": {"message": "out of order"}}
        return 200, completion(row.answer if row.question_index else "None of them.")

    with serving(reply) as (url, bodies):
        how = ("--model", "openai-api/local/tiny", "--base-url", url, "--rotations", 3,
               "--size", 64, "--items", "0,1,2", "--tries", 1, "--out", "p.h5")  # fmt: skip
        assert bench_ask(asked.path, *how)[0] == 0
        (log,) = (tmp_path / "logs").glob("*.eval")
        assert set(read_returned(log).failures) == {(1, 0), (2, 2)}
        with open_predictions(tmp_path / "p.h5") as opened:
            assert (opened.method, opened.rows.tolist()) == ("openai-api/local/tiny", [0, 2])
        assert len(bodies) == 9
        failing.clear()
        assert bench_ask(asked.path, *how)[0] == 2  # p.h5 is there
        assert bench_ask(asked.path, *how, "--overwrite")[0] == 0
        assert len(bodies) == 9 + 2
    scores = score([tmp_path / "p.h5"], asked.path, Settings(allow_partial=True))
    assert scores.metrics["iqtt_accuracy"].value == pytest.approx(2 / 3)
    assert scores.answer_groups["by_outcome"]["unparsed"].n == 1
    assert scores.by_circle["every order"]["iqtt_accuracy"].n == 3
    (log,) = (tmp_path / "logs").glob("*.eval")
    assert read_returned(log).tokens == (90, 18)
    assert KEY.encode() not in log.read_bytes()
    whole = read_eval_log(str(log))
    told = {name: m.value for s in whole.results.scores for name, m in s.metrics.items()}
    expected = {"accuracy": 2 / 3, "circular_accuracy": 2 / 3, "unparsed": 1 / 3}
    assert {name: told[name] for name in expected} == pytest.approx(expected)
    samples = {sample.id: sample for sample in whole.samples}
    samples["0-0"].output.choices[0].stop_reason = "content_filter"
    samples["0-1"].output.choices[0].stop_reason = "max_tokens"
    samples["1-0"].limit = EvalSampleLimit(type="time", limit=1)
    samples["1-1"].invalidation = ProvenanceData(author="a", reason="wrong picture")
    samples["2-0"].output.choices = []
    write_eval_log(whole, "limits.json")
    limits = read_returned(tmp_path / "limits.json")
    assert set(limits.failures) == {(1, 0), (1, 1), (2, 0)}
    outcomes = {(a.question, a.rotation): a.outcome for a in limits.answers}
    assert (outcomes[0, 0], outcomes[0, 1], outcomes[2, 1]) == ("refused", "cut off", "answered")


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
def test_what_cannot_be_asked_is_one_line(quiz_split, tmp_path, bench_ask, model):
    """No such provider, no provider, no key, no key, no server."""
    how = ("--out", "p.h5", "--items", 0, "--size", 64, "--tries", 1)
    code, line = bench_ask(quiz_split / "iqtt-test.h5", "--model", *model, *how)
    assert (code, line.startswith("Error: ")) == (2, True), line
    assert not (tmp_path / "p.h5").exists()
