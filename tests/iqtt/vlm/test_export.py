"""What a folder for models holds, read by the readers that people have."""

import base64
import csv
import io
import math
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from sheets import find

from iqtt.files.reader import QuestionsFile
from iqtt.vlm import harness
from iqtt.vlm.export import CIRCULAR, COLUMNS, FACTS, export_for_models
from iqtt.vlm.pictures import composed, draw_pictures, stored_question
from iqtt.vlm.reading import LETTERS
from iqtt.vlm.rows import Asked, vlm_rows
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.rooms.preview import srgb_bytes

datasets = pytest.importorskip("datasets")


@pytest.fixture(scope="module")
def asked(split_folder):
    """How the six questions of validation are asked in every order, drawn small."""
    return Asked(split_folder / "iqtt-val.h5", rotations=3, size=64)


@pytest.fixture(scope="module")
def folder(asked, tmp_path_factory):
    folder = tmp_path_factory.mktemp("vlm") / "out"
    export_for_models(asked, folder)
    return folder


def test_parquet_tells_every_column(folder, asked, tmp_path):
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


def test_sheets_follow_the_rules_of_circular_evaluation(folder, asked):
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


def test_a_withheld_test_has_no_column_that_tells(split_folder, tmp_path):
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


def test_lmms_eval_tasks_score_texts(folder, tmp_path):
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


def test_the_letter_of_every_rotation_shows_the_right_answer(asked):
    rows = list(vlm_rows(asked))
    assert [row.id for row in rows[:4]] == ["0-0", "0-1", "0-2", "1-0"]
    with QuestionsFile(asked.path) as questions:
        for row in rows:
            letter = LETTERS.index(row.answer or "")
            assert row.original(letter) == questions[row.question_index].answer
            first = rows[3 * row.question_index]
            for k in range(3):
                assert row.images[1 + k] == first.images[1 + row.original(k)]
            assert row.images[0] == first.images[0]


def test_pictures_are_the_stored_ones_drawn_finer(asked):
    with QuestionsFile(asked.path) as questions:
        assert questions.spec is not None
        truths = [truth for i in range(6) if (truth := questions.truth(i)) is not None]
        shown = [stored_question(questions.spec, truth) for truth in truths]
        drawn = list(draw_pictures(questions.spec, shown, 64))
        for record, pictures in zip(questions, drawn, strict=True):
            stored = srgb_bytes(record.radiance).repeat(2, axis=1).repeat(2, axis=2)
            differs = np.abs(stored.astype(int) - pictures).max(axis=-1) > 3
            # A ray through a pixel's centre and the mean of its four corners differ at edges only.
            assert differs.mean() < 0.12
            inside = ~differs
            assert np.abs(stored.astype(int) - pictures)[inside].mean() < 1


def test_a_composed_picture_holds_the_pictures_themselves():
    pictures = np.random.default_rng(0).integers(0, 256, (4, 64, 80, 3), np.uint8)
    at = [find(np.asarray(composed(pictures)), picture) for picture in pictures]
    assert at[0][0] < at[1][0] == at[2][0] == at[3][0]
    assert at[1][1] < at[2][1] < at[3][1]


def test_a_withheld_test_tells_nothing_beside_its_pictures(split_folder):
    test = Asked(split_folder / "iqtt-test.h5", size=64)
    for row in vlm_rows(test):
        assert row.answer is None
        assert set(row.facts.values()) == {None}
    told = list(vlm_rows(replace(test, with_answers=True)))
    with QuestionsFile(test.path, answers=split_folder / "iqtt-test-answers.h5") as questions:
        assert [LETTERS.index(row.answer or "") for row in told] == [q.answer for q in questions]


def test_a_file_that_cannot_be_drawn_is_refused(split_folder, tmp_path):
    alone = tmp_path / "iqtt-test.h5"
    alone.write_bytes((split_folder / "iqtt-test.h5").read_bytes())
    with pytest.raises(FileFormatError):
        next(vlm_rows(Asked(alone, size=64)))
    for change in ({"rotations": 2}, {"size": 8}, {"answers": split_folder / "iqtt-val.h5"}):
        with pytest.raises((SpecError, FileFormatError)):
            next(vlm_rows(replace(Asked(alone), **change)))
