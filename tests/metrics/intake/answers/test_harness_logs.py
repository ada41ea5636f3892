"""Logs of harnesses become submissions with the answers that the models gave."""

import csv
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from iqtt.files.make import make_split
from iqtt.questions.specs import SplitSpec
from iqtt.vlm.export import CIRCULAR, export_for_models, row_values
from iqtt.vlm.harness import process_results
from iqtt.vlm.rows import Asked, vlm_rows
from metrics.intake.answers.harness_logs import is_log, read_returned, write_returned
from metrics.scoring.evaluate import score
from metrics.scoring.runs import Settings
from scenegen.common.errors import FileFormatError, SceneGenError

TEXTS = ["The answer is {}.", "\\boxed{{{}}}", "I cannot see it.", "A or B"]


@pytest.fixture(scope="module")
def split(tmp_path_factory):
    spec = SplitSpec(
        seed=3, train=1, labeled=1, val=8, test=8, cubes=(5, 6), height=32, width=32,
        min_cube_pixels=2,
    )  # fmt: skip
    folder = tmp_path_factory.mktemp("split") / "split"
    make_split(folder, spec, command="tests")
    return folder


@pytest.fixture(scope="module")
def rows(split):
    return list(vlm_rows(Asked(split / "iqtt-val.h5", rotations=3, size=64)))


# What lmms-eval and VLMEvalKit write where no reply came.
NO_REPLY = [
    None, "", "  ", "[LMMS_EVAL_REQUEST_FAILED after 5 retries] Connection error.",
    "Failed to obtain answer via API.", "Failed to obtain answer: <class 'RuntimeError'> CUDA",
    "Fail to obtain answer via API.", "Error: Bad Response Statuse Code. ",
]  # fmt: skip


def text_for(row):
    """Right where the question is even; else a refusal or two letters, in some order."""
    if row.question_index % 2 == 0:
        return TEXTS[row.rotation % 2].format(row.answer)
    return TEXTS[2 + row.question_index % 4 // 2]


def lmms_log(path, rows, text=text_for):
    lines = []
    for number, row in enumerate(rows):
        kept = process_results(row_values(row), [text(row) or ""])
        lines.append({"doc_id": number, "filtered_resps": text(row), **kept})
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return path


def sheet(path, rows, text=text_for):
    heading = ["index", "question", "A", "B", "C", "prediction"]
    table = [
        [row.question_index + row.rotation * CIRCULAR, row.question, "picture A", "picture B",
         "picture C", text(row)]
        for row in rows
    ]  # fmt: skip
    if path.suffix == ".xlsx":
        from openpyxl import Workbook

        book = Workbook()
        for line in (heading, *table):
            book.active.append(line)
        book.save(path)
        return path
    with path.open("w", newline="") as file:
        csv.writer(file, delimiter="\t" if path.suffix == ".tsv" else ",").writerows(
            (heading, *table)
        )
    return path


@pytest.mark.slow
def test_lmms_eval_runs_the_task_and_its_samples_come_back(split, rows, tmp_path):
    python = python_with("lmms_eval")
    export_for_models(Asked(split / "iqtt-val.h5", rotations=3, size=64), tmp_path / "in")
    done = subprocess.run(
        [python, "-m", "lmms_eval", "--model", "dummy", "--model_args", "response=B",
         "--include_path", "in", "--tasks", "iqtt", "--log_samples", "--output_path", "out"],
        capture_output=True, text=True, check=False, cwd=tmp_path,
        env=os.environ | {"HF_HUB_OFFLINE": "1", "HF_HOME": str(tmp_path / "hf"),
                          "PYTHONPATH": str(Path(__file__).parents[4])},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    (log,) = tmp_path.glob("out/**/*_samples_iqtt.jsonl")
    (results,) = tmp_path.glob("out/**/*_results.json")
    told = json.loads(results.read_text())["results"]["iqtt"]
    assert told["accuracy,none"] == pytest.approx(np.mean([row.answer == "B" for row in rows]))
    write_returned(tmp_path / "p.h5", split / "iqtt-val.h5", read_returned(log), method="m")
    scores = score([tmp_path / "p.h5"], split / "iqtt-val.h5")
    right = np.mean([row.answer == "B" for row in rows if row.rotation == 0])
    assert scores.metrics["iqtt_accuracy"].value == right
    assert scores.unread == 0.0


VLMEVALKIT = """
import os, sys
folder, out, texts = sys.argv[1], sys.argv[2], __import__("json").loads(sys.argv[3])
os.environ["LMUData"] = folder
from vlmeval.dataset import build_dataset
from vlmeval.inference import infer_data_job
from vlmeval.vlm.base import BaseModel

class Told(BaseModel):
    def generate_inner(self, message, dataset=None):
        return texts.pop(0)

for name in ("iqtt-val", "iqtt-val_circular"):
    infer_data_job(Told(), out, "told", build_dataset(name))
"""


def python_with(package):
    """Return the Python of the environment that has a harness, which `make harnesses` makes."""
    own = Path(__file__).parents[4] / f".venv-{package}" / "bin" / "python"
    python = str(own) if own.exists() else os.environ.get("HARNESS_PYTHON", sys.executable)
    probe = f"import importlib.util, sys; sys.exit(importlib.util.find_spec({package!r}) is None)"
    if subprocess.run([python, "-c", probe], check=False).returncode:
        pytest.skip(f"{package} is not installed; `make harnesses` does that")
    return python


def vlmevalkit_log(path, rows, split):
    """Run VLMEvalKit with a model that is told what to say; return its sheet of all rows."""
    python = python_with("vlmeval")
    export_for_models(Asked(split / "iqtt-val.h5", rotations=3, size=64), path / "in")
    first = [text_for(row) for row in rows if row.rotation == 0]
    texts = json.dumps([*first, *map(text_for, rows)])
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        [python, "-W", "ignore", "-c", VLMEVALKIT, str(path / "in"), str(path), texts],
        capture_output=True, text=True, check=False, cwd=path,
        env=environment | {"HF_HUB_OFFLINE": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    alone = read_returned(path / "told_iqtt-val.xlsx")
    assert [answer.outcome == "answered" for answer in alone.answers] == [True, False] * 4
    return path / "told_iqtt-val_circular.xlsx"


LOGS = {"samples.jsonl": lmms_log, "out.tsv": sheet, "out.xlsx": sheet}


@pytest.mark.parametrize("kind", [*LOGS, pytest.param("vlmevalkit", marks=pytest.mark.slow)])
def test_answers_come_back_from_every_harness(split, rows, tmp_path, kind):
    log = (
        LOGS[kind](tmp_path / kind, rows) if kind in LOGS else vlmevalkit_log(tmp_path, rows, split)
    )
    assert is_log(log)
    out = tmp_path / "p.h5"
    write_returned(out, split / "iqtt-val.h5", read_returned(log), method="m")
    scores = score([out], split / "iqtt-val.h5")
    assert scores.metrics["iqtt_accuracy"].value == 0.5
    groups = scores.answer_groups
    assert groups["by_circle"]["every order"].right == (4,)
    assert {name: g.n for name, g in groups["by_outcome"].items()} == {
        "answered": 4, "refused": 2, "unparsed": 2,
    }  # fmt: skip
    assert groups["by_answer"]["none"].n == 4


@pytest.mark.parametrize("name", ["log.jsonl", "out.tsv", "out.xlsx"])
def test_a_row_that_failed_has_no_answer(split, rows, tmp_path, name):
    failed = ["1-0", "2-1", "3-0", "3-1", "3-2", "4-1", "4-2", "5-2"]
    nothing = dict(zip(failed, NO_REPLY, strict=True))
    write = lmms_log if name.endswith("jsonl") else sheet
    log = read_returned(write(tmp_path / name, rows, lambda r: nothing.get(r.id, r.answer)))
    assert sorted(f"{question}-{rotation}" for question, rotation in log.failures) == failed
    assert len(log.answers) == len(rows) - len(failed)
    out = tmp_path / "p.h5"
    assert write_returned(out, split / "iqtt-val.h5", log, method="m") == 6
    with pytest.raises(SceneGenError):
        score([out], split / "iqtt-val.h5")
    scores = score([out], split / "iqtt-val.h5", Settings(allow_partial=True))
    assert scores.metrics["iqtt_accuracy"].value == 1.0
    assert (len(scores.ids), scores.unread, scores.comparable) == (6, 0.0, False)
    circle = scores.by_circle["every order"]["iqtt_accuracy"]
    assert (circle.n, circle.value) == (3, 1.0)  # the other three were not answered in all orders
    path = write(tmp_path / f"all-{name}", rows, lambda _: "Failed to obtain answer via API.")
    with pytest.raises(FileFormatError) as info:
        read_returned(path)
    assert f"{len(rows)} of {len(rows)}" in info.value.found


def test_a_row_that_was_answered_at_another_try_is_an_answer(rows, tmp_path):
    path, again = tmp_path / "log.jsonl", tmp_path / "again.jsonl"
    lmms_log(path, rows, lambda row: "" if row.rotation else row.answer)
    path.write_bytes(path.read_bytes() + lmms_log(again, rows[1:2]).read_bytes())
    log = read_returned(path)
    assert (1, 1) in log.failures
    assert (0, 1) not in log.failures
    assert len(log.answers) + len(log.failures) == len(rows)


def test_lmms_eval_keeps_refusals_and_texts_before_its_filters(rows, tmp_path):
    path = lmms_log(tmp_path / "log.jsonl", rows[:3], lambda row: "B")
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    lines[0]["filtered_resps"] = "[SAFETY_BLOCKED:finish_reason is 2]"
    lines[1] |= {"filtered_resps": "", "resps": [["<think>A"]]}
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    log = read_returned(path)
    assert [answer.outcome for answer in log.answers] == ["refused", "unparsed", "answered"]
    assert not log.failures


def test_a_log_of_other_questions_or_with_two_answers_is_refused(split, rows, tmp_path):
    val = split / "iqtt-val.h5"
    refused = {
        "other digest": [replace(row, digest="0" * 64) for row in rows],
        "no such question": [replace(row, question_index=8) for row in rows],
        "twice": [rows[0], rows[0]],
        "not all": rows[3:],
        **{f"order {n}": [replace(rows[0], rotation=n), *rows[1:]] for n in (-1, 3, 7)},
    }
    for name, changed in refused.items():
        path, out = lmms_log(tmp_path / f"{name}.jsonl", changed), tmp_path / f"{name}.h5"

        def score_returned(path=path, out=out):
            write_returned(out, val, read_returned(path), method="m")
            score([out], val)

        with pytest.raises(SceneGenError):
            score_returned()


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.jsonl", b"nonsense\n"), ("a.jsonl", b'{"doc_id": 1, "doc": {}}\n'), ("a.eval", b"PK"),
        ("a.json", b"{}"), ("a.tsv", b"index\tprediction\nx\tA\n"), ("a.csv", b"\xff\xfe\n"),
        ("a.xlsx", b"PK"), ("a.jsonl", b""), ("a.tsv", b"index\tprediction\n"),
        ("a.jsonl", b"[1]\n"),
    ],
)  # fmt: skip
def test_a_damaged_log_is_one_clear_error(tmp_path, name, content):
    (tmp_path / "answers.csv").write_text("index,prediction\n0,B\n1,C\n")
    assert not is_log(tmp_path / "answers.csv")
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(FileFormatError):
        read_returned(path)


def test_a_question_is_circularly_right_only_in_every_order(split, rows, tmp_path):
    log = lmms_log(tmp_path / "log.jsonl", rows)
    right = [text_for(row) for row in rows]
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    for row, line, text in zip(rows, lines, right, strict=True):
        spoilt = row.question_index == 2 and row.rotation == 1  # whose rotation 0 is right
        line["filtered_resps"] = ["none"] if spoilt else [text]
    log.write_text("".join(json.dumps(line) + "\n" for line in lines))
    out = tmp_path / "p.h5"
    write_returned(out, split / "iqtt-val.h5", read_returned(log), method="m")
    scores = score([out], split / "iqtt-val.h5")
    assert scores.metrics["iqtt_accuracy"].value == 0.5
    assert scores.by_circle["every order"]["iqtt_accuracy"].value == 3 / 8
    assert {name: group["iqtt_accuracy"].value for name, group in scores.by_outcome.items()} == {
        "answered": 1.0, "refused": 0.0, "unparsed": 0.0,
    }  # fmt: skip


def test_what_bench_ask_kept_before_it_ran_inspect_is_read(split, rows, tmp_path):
    heading = {
        "format": "pix2shape-bench/asked", "model": "tiny", "temperature": 0.0, "max_tokens": 9,
        "layout": "composed", "size": 64, "control": False, "digest": rows[0].digest,
    }  # fmt: skip
    lines = [
        {"id": row.id, "question_index": row.question_index, "rotation": row.rotation,
         "answer": row.original(2), "outcome": "answered", "text": "C"}
        for row in rows
    ]  # fmt: skip
    lines[0] |= {"answer": None, "outcome": "unparsed"}
    log = tmp_path / "log.jsonl"
    again = [*lines, heading, lines[1] | {"answer": 0}]  # two processes; the first reply counts
    log.write_text("".join(json.dumps(line) + "\n" for line in [heading, *again]) + '{"id": "9-')
    assert is_log(log)
    whole = read_returned(log)
    assert (whole.model, len(whole.answers)) == ("tiny", 24)
    assert [answer.answer for answer in whole.answers[:3]] == [-1, 0, 1]
    write_returned(tmp_path / "p.h5", split / "iqtt-val.h5", whole)
    scores = score([tmp_path / "p.h5"], split / "iqtt-val.h5")
    assert scores.answer_groups["by_outcome"]["unparsed"].n == 1
