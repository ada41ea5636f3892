"""Logs of harnesses become submissions with the answers that the models gave."""

import csv
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chat_server import completion, serving

from iqtt.files.make import make_split
from iqtt.questions.specs import SplitSpec
from iqtt.vlm.ask import ask
from iqtt.vlm.export import CIRCULAR, export_for_models, row_values
from iqtt.vlm.harness import process_results
from iqtt.vlm.reading import LETTERS
from iqtt.vlm.rows import Asked, Row, vlm_rows
from metrics.intake.harness_logs import is_log, read_returned, write_returned
from metrics.scoring.evaluate import score
from scenegen.common.errors import FileFormatError, SceneGenError

TEXTS = ["The answer is {}.", "\\boxed{{{}}}", "I cannot see it.", "A or B"]


@pytest.fixture(scope="module")
def split(tmp_path_factory: pytest.TempPathFactory) -> Path:
    spec = SplitSpec(
        seed=3, train=1, labeled=1, val=8, test=8, cubes=(5, 6), height=32, width=32,
        min_cube_pixels=2,
    )  # fmt: skip
    folder = tmp_path_factory.mktemp("split") / "split"
    make_split(folder, spec, command="tests")
    return folder


@pytest.fixture(scope="module")
def rows(split: Path) -> list[Row]:
    return list(vlm_rows(Asked(split / "iqtt-val.h5", rotations=3, size=64)))


def text_for(row: Row) -> str:
    """Right where the question is even; else a refusal or two letters, in some order."""
    if row.question_index % 2 == 0:
        return TEXTS[row.rotation % 2].format(row.answer)
    return TEXTS[2 + row.question_index % 4 // 2]


def lmms_log(path: Path, rows: list[Row]) -> Path:
    lines = []
    for number, row in enumerate(rows):
        kept = process_results(row_values(row), [text_for(row)])
        lines.append({"doc_id": number, "filtered_resps": text_for(row), **kept})
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return path


def sheet(path: Path, rows: list[Row]) -> Path:
    heading = ["index", "question", "A", "B", "C", "prediction"]
    table = [
        [row.question_index + row.rotation * CIRCULAR, row.question, "picture A", "picture B",
         "picture C", text_for(row)]
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


INSPECT = """
import json, sys
import inspect_ai
from inspect_ai.model import ModelOutput, ModelUsage, get_model
folder, logs, texts = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])

def output(messages, *_):
    out = ModelOutput.from_content("mockllm", texts[messages[-1].text])
    return out.model_copy(update={"usage": ModelUsage(input_tokens=1, output_tokens=1)})

from inspect_ai._util.registry import registry_lookup
task = registry_lookup("task", "pix2shape_bench/iqtt")(folder)
for sample in task.dataset:  # so that the model knows which row it sees
    sample.input[0].content[-1].text = sample.id
model = get_model("mockllm/model", custom_outputs=output)
(log,) = inspect_ai.eval(task, model=model, log_dir=logs, display="none")
assert log.status == "success", log.error
print(json.dumps({n: m.value for s in log.results.scores for n, m in s.metrics.items()}))
"""


def inspect_log(path: Path, rows: list[Row], split: Path) -> Path:
    """Run Inspect as its users do: by the name of the task, in a process of its own."""
    pytest.importorskip("inspect_ai")
    export_for_models(Asked(split / "iqtt-val.h5", rotations=3, size=64), path / "in")
    texts = json.dumps({row.id: text_for(row) for row in rows})
    done = subprocess.run(
        [sys.executable, "-c", INSPECT, str(path / "in"), str(path), texts],
        capture_output=True, text=True, check=False, cwd=path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[:3000]
    scores = json.loads(done.stdout.splitlines()[-1])
    assert (scores["accuracy"], scores["circular_accuracy"], scores["unparsed"]) == (0.5, 0.5, 0.5)
    floor = np.mean([row.facts["floor"] for row in rows])
    assert scores["skill"] == pytest.approx((0.5 - floor) / (1 - floor))
    assert 0 < scores["stderr"] < 0.5
    kinds = {row.facts["kind"] for row in rows}
    assert kinds < set(scores)
    return next(path.glob("*.eval"))


@pytest.mark.parametrize(
    "kind",
    ["samples.jsonl", "out.tsv", "out.xlsx", pytest.param("inspect", marks=pytest.mark.slow)],
)
def test_answers_come_back_from_every_harness(
    split: Path, rows: list[Row], tmp_path: Path, kind: str
) -> None:
    if kind == "inspect":
        log = inspect_log(tmp_path, rows, split)
    else:
        log = (lmms_log if kind.endswith("jsonl") else sheet)(tmp_path / kind, rows)
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


def returned_score(log: Path, questions: Path) -> None:
    out = log.with_suffix(".h5")
    write_returned(out, questions, read_returned(log))
    score([out], questions)


def test_a_log_of_other_questions_or_with_two_answers_is_refused(
    split: Path, rows: list[Row], tmp_path: Path
) -> None:
    val = split / "iqtt-val.h5"
    refused = {
        "other digest": [replace(row, digest="0" * 64) for row in rows],
        "no such question": [replace(row, question_index=8) for row in rows],
        "twice": [rows[0], rows[0]],
        "not all": rows[3:],
    }
    for name, changed in refused.items():
        path = lmms_log(tmp_path / f"{name}.jsonl", changed)
        with pytest.raises(SceneGenError):
            returned_score(path, val)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.jsonl", b"nonsense\n"), ("a.jsonl", b'{"doc_id": 1, "doc": {}}\n'), ("a.eval", b"PK"),
        ("a.json", b"{}"), ("a.tsv", b"index\tprediction\nx\tA\n"), ("a.csv", b"\xff\xfe\n"),
        ("a.xlsx", b"PK"), ("a.jsonl", b""), ("a.tsv", b"index\tprediction\n"),
        ("a.jsonl", b"[1]\n"),
    ],
)  # fmt: skip
def test_a_damaged_log_is_one_clear_error(tmp_path: Path, name: str, content: bytes) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(FileFormatError):
        read_returned(path)


def test_a_question_is_circularly_right_only_in_every_order(
    split: Path, rows: list[Row], tmp_path: Path
) -> None:
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


def test_letters_lean(split: Path, rows: list[Row], tmp_path: Path) -> None:
    constant = [row for row in rows if row.rotation == 0]
    lines = [
        {"doc_id": 0, "doc": {"question_index": row.question_index, "rotation": 0,
                              "choices": list(LETTERS[:3]), "digest": row.digest},
         "filtered_resps": "C"}
        for row in constant
    ]  # fmt: skip
    log = tmp_path / "c.jsonl"
    log.write_text("".join(json.dumps(line) + "\n" for line in lines))
    write_returned(tmp_path / "p.h5", split / "iqtt-val.h5", read_returned(log), method="m")
    scores = score([tmp_path / "p.h5"], split / "iqtt-val.h5")
    assert {name: group.n for name, group in scores.answer_groups["by_answer"].items()} == {"2": 8}
    assert np.isclose(
        scores.metrics["iqtt_accuracy"].value, np.mean([row.answer == "C" for row in constant])
    )


def test_a_list_of_answers_is_no_log(tmp_path: Path) -> None:
    path = tmp_path / "answers.csv"
    path.write_text("index,prediction\n0,B\n1,C\n")
    assert not is_log(path)


@pytest.mark.parametrize("rotation", [-1, 3, 7])
def test_an_order_that_was_never_asked_is_refused(
    split: Path, rows: list[Row], tmp_path: Path, rotation: int
) -> None:
    log = lmms_log(tmp_path / "log.jsonl", [replace(rows[0], rotation=rotation), *rows[1:]])
    with pytest.raises(FileFormatError):
        returned_score(log, split / "iqtt-val.h5")


def test_a_log_of_bench_ask_may_end_in_a_line_that_was_cut(split: Path, tmp_path: Path) -> None:
    asked, log = Asked(split / "iqtt-val.h5", rotations=3, size=64), tmp_path / "log.jsonl"
    with serving(lambda *_: completion("C")) as (server, _):
        ask(asked, server, log)
    whole = read_returned(log)
    assert (whole.model, len(whole.answers)) == ("tiny", 24)
    log.write_bytes(log.read_bytes() + b'{"id": "9-')
    assert read_returned(log).answers == whole.answers
