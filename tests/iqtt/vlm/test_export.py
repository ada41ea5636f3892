"""What a folder for models holds, read by the readers that people have."""

import base64
import csv
import io
import math
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from iqtt.vlm import harness
from iqtt.vlm.export import CIRCULAR, COLUMNS, FACTS, export_for_models
from iqtt.vlm.rows import Asked, vlm_rows

datasets = pytest.importorskip("datasets")


@pytest.fixture(scope="module")
def folder(asked: Asked, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("vlm") / "out"
    export_for_models(asked, folder)
    return folder


def test_parquet_tells_every_column(folder: Path, asked: Asked, tmp_path: Path) -> None:
    rows = list(vlm_rows(asked))
    for name, reference in (("questions", True), ("control", False)):
        file = str(folder / f"{name}.parquet")
        table = datasets.load_dataset("parquet", data_files=file, cache_dir=str(tmp_path))["train"]
        assert table.column_names == list(COLUMNS)
        assert len(table) == (len(rows) if reference else 6)
        first = table[0]
        assert first["image"].mode == "RGB"
        assert len(first["images"]) == 3 + reference
        assert first["answer"] == rows[0].answer
        assert first["digest"] == rows[0].digest
    assert first["image"].height < Image.open(io.BytesIO(rows[0].image)).height


def test_sheets_follow_the_rules_of_circular_evaluation(folder: Path, asked: Asked) -> None:
    rows = {row.id: row for row in vlm_rows(asked)}
    csv.field_size_limit(1 << 30)
    with (folder / "iqtt-val_circular.tsv").open(newline="") as file:
        lines = list(csv.DictReader(file, delimiter="\t"))
    assert len(lines) == 18
    for line in lines:
        rotation, question = divmod(int(line["index"]), CIRCULAR)
        row = rows[f"{question}-{rotation}"]
        assert line["g_index"] == str(question)
        assert base64.b64decode(line["image"]) == row.image
        assert (line["answer"], line["question"]) == (row.answer, row.question)
    with (folder / "iqtt-val.tsv").open(newline="") as file:
        assert [line["index"] for line in csv.DictReader(file, delimiter="\t")] == list("012345")


def test_a_withheld_test_has_no_column_that_tells(split_folder: Path, tmp_path: Path) -> None:
    test = Asked(split_folder / "iqtt-test.h5", size=64)
    export_for_models(test, tmp_path / "out")
    import pyarrow.parquet as pq

    names = pq.read_schema(tmp_path / "out" / "questions.parquet").names
    assert set(names) == set(COLUMNS) - set(FACTS)
    heading = (tmp_path / "out" / "iqtt-test.tsv").read_text().split("\n")[0].split("\t")
    assert "answer" not in heading
    with pytest.raises(FileExistsError):
        export_for_models(test, tmp_path / "out")
    export_for_models(replace(test, with_answers=True), tmp_path / "out", overwrite=True)
    assert "answer" in pq.read_schema(tmp_path / "out" / "questions.parquet").names


def test_lmms_eval_tasks_score_texts(folder: Path, tmp_path: Path) -> None:
    yaml = pytest.importorskip("yaml")

    class Loader(yaml.SafeLoader):
        pass

    Loader.add_constructor("!function", lambda _, node: getattr(harness, node.value.split(".")[1]))
    task = yaml.load((folder / "iqtt.yaml").read_text(), Loader)
    table = datasets.load_dataset(
        task["dataset_path"], **task["dataset_kwargs"], cache_dir=str(tmp_path)
    )[task["test_split"]]
    texts = ["The answer is {}.", "(D)", "{}"]
    results = []
    for i, doc in enumerate(table):
        assert len(task["doc_to_visual"](doc)) == 1
        assert task["doc_to_text"](doc, {"post_prompt": "!"}).endswith(doc["question"][-9:] + "!")
        text = texts[i % 3] if i % 18 in (0, 1, 2) else "{}"
        text = text.format(doc[task["doc_to_target"]])
        results.append(task["process_results"](doc, [text]))
    means = {
        metric["metric"]: metric["aggregation"]([row[metric["metric"]] for row in results])
        for metric in task["metric_list"]
    }
    assert means["accuracy"] == pytest.approx(17 / 18)
    assert means["circular_accuracy"] == pytest.approx(5 / 6)
    assert means["unparsed"] == pytest.approx(1 / 18)
    assert math.isnan(means["skill"])  # no floor is known of pictures of this size
    for row in results:
        row["skill"] = row["skill"] | {"floor": 0.4}
    skill = next(m["aggregation"] for m in task["metric_list"] if m["metric"] == "skill")
    assert skill([row["skill"] for row in results]) == pytest.approx((17 / 18 - 0.4) / 0.6)
    assert results[0]["accuracy"][task["cluster_key"]] == table[0]["shape"]
