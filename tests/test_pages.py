"""Every page's blocks of bash and Python run in order, in an empty folder.

Pages with a test of what they print are run there.
"""

import json

import pytest
from page_blocks import ROOT, blocks, missing_lines, run_block

from metrics.submissions.reader import open_predictions

RUN_ELSEWHERE = {"training-data.md", "tutorial.md", "evaluate.md"}
CLUSTER = {"scale.md"}  # needs a scheduler and its workers


def runnable(page):
    return [block for block in blocks(page) if block[0] in ("bash", "python")]


PAGES = [path.name for path in sorted((ROOT / "docs").glob("*.md"))]
RUN_HERE = [page for page in PAGES if runnable(page) and page not in RUN_ELSEWHERE | CLUSTER]


@pytest.mark.parametrize("page", RUN_HERE)
def test_the_blocks_run(page, tmp_path):
    if page == "sharing.md":
        pytest.importorskip("datasets")
    home = f"export HOME={tmp_path}\n"  # blocks that write to it write here
    for language, title, code in runnable(page):
        run_block(language, title, home + code if language == "bash" else code, tmp_path)


SMALLER = (("--n 200", "--n 20"), ("--test 200", "--test 20"))  # --n 2000 becomes --n 200


def printed_by_page(folder, smaller=()):
    """Run the page with smaller numbers; return (text of the page, what was printed) pairs."""
    printed, pairs = "", []
    for language, title, written in blocks("tutorial.md"):
        if language == "text":
            pairs.append((written, printed))
            continue
        code = written
        for words, fewer in smaller:
            code = code.replace(words, fewer)
        printed = run_block(language, title, code, folder) or printed
    assert len(pairs) >= 6
    for name in ("mine.html", "leaderboard.md"):
        assert "kernel ridge" in (folder / name).read_text()
    return pairs


def test_the_blocks_run_on_a_tenth_of_the_rows(tmp_path):
    """One test, so that one worker runs the page, once."""
    for text, printed in printed_by_page(tmp_path, SMALLER):
        begins = [line.split()[0] for line in printed.splitlines() if line.strip()]
        names = [line.split()[0] for line in text.splitlines()]
        assert [name for name in names if name.isidentifier() and name not in begins] == []


@pytest.mark.slow
def test_the_blocks_print_what_the_page_says(tmp_path):
    pairs = printed_by_page(tmp_path)
    assert [missing_lines(*pair) for pair in pairs] == [[]] * len(pairs)


def test_a_wrong_number_is_noticed():
    line = "  chamfer  -1.2562  [-1.4430, -1.0969]  0: empty room\n"
    assert missing_lines(line, line.replace("1.2562", "1.2570")) == []
    for wrong in (line.replace("-1.2562", "1.2562"), line.replace("1.2562", "1.3"), line[:-6]):
        assert missing_lines(line, wrong) == [line.rstrip("\n")]


BLOCKS = blocks("evaluate.md")
DOORS = ("bench import --depth", "bench run my_model.py", "metrics.evaluate(")
SCORE_ANSWERS = "bench score answers.h5 --truth iqtt-split/iqtt-test-answers.h5"


def shorter(code):
    return code.replace("--n 32 --size 64", "--n 8 --size 32")


def test_the_programs_read_every_row_and_what_they_write_can_be_scored(tmp_path):
    """One test, so that one worker runs the page, once; with fewer and smaller rooms to score."""
    printed = {
        code: run_block(language, title, shorter(code), tmp_path)
        for language, title, code in BLOCKS
    }
    (scored,) = [text for code, text in printed.items() if "bench validate" in code]
    assert scored.startswith("mine.h5: valid\nmine on rooms.h5: 8 images, 8 scenes ")
    (training,) = [text for code, text in printed.items() if "metrics.evaluate(" in code]
    first, second, last = (line.split() for line in training.splitlines())
    assert float(second[2]) < float(first[2])  # half the shift has half the error
    assert float(last[0]) == pytest.approx(0.025, rel=1e-3)
    assert json.loads((tmp_path / "mine.json").read_text())["summary"]["comparable"]
    doors = (next(c for c in printed if words in c) for words in DOORS)
    assert all(len(code.splitlines()) <= 10 for code in doors)
    with open_predictions(tmp_path / "letters.h5") as found:
        assert found.answers.tolist() == [0, 1, 2] * 3
    assert "9 questions" in run_block("bash", "", SCORE_ANSWERS, tmp_path)


IMAGE, DEPTH = "16, 32, 32, 3", "16, 32, 32"  # sizes of a batch
LOADED = {  # what the blocks of training-data.md print, by words of theirs
    "RoomStream(": "torch.Size([16, 3, 64, 64]) torch.Size([16, 3, 64, 64]) True\n" * 4,
    "DataLoader(rooms": f"torch.Size([{IMAGE}]) torch.Size([{DEPTH}]) torch.Size([{IMAGE}])\n" * 4,
    "np.array_split(": f"({IMAGE}) ({DEPTH}) ({IMAGE})\n" * 4,
    "load_dataset(": f"({IMAGE}) ({DEPTH}) ({IMAGE})\n" * 4,
}


def test_loaders_and_streams_give_every_row(tmp_path):
    pytest.importorskip("datasets")
    blocks_of_page = blocks("training-data.md")
    printed = {code: run_block(lang, title, code, tmp_path) for lang, title, code in blocks_of_page}
    for words, lines in LOADED.items():
        assert [text for code, text in printed.items() if words in code] == [lines]


TASK = """
import inspect_ai
from inspect_ai.model import ModelOutput, ModelUsage, get_model
from pix2shape_bench import iqtt

def always_b(*_):
    output = ModelOutput.from_content("mockllm", "The answer is picture B.")
    return output.model_copy(update={"usage": ModelUsage(input_tokens=1, output_tokens=1)})

model = get_model("mockllm/model", custom_outputs=always_b)
(log,) = inspect_ai.eval(iqtt("val-vlm"), model=model, log_dir="logs", display="none")
for score in log.results.scores:
    for name, metric in score.metrics.items():
        print(name, metric.value)
"""
BEFORE = """
iqtt make-split --train 10 --size 64 --val 12 --test 12 --out questions
iqtt export questions/iqtt-val.h5 --format vlm --rotations 3 --size 64 --out val-vlm
"""
AFTER = """
bench import --responses logs/*.eval --data questions/iqtt-val.h5 --method always-b --out b.h5
bench score b.h5 --truth questions/iqtt-val.h5
"""


@pytest.mark.slow
def test_the_task_of_a_folder_runs_in_inspect(tmp_path):
    """The mock model needs no network."""
    run_block("bash", "", BEFORE, tmp_path)
    printed = run_block("python", "", TASK, tmp_path).splitlines()
    rows = dict(line.split() for line in printed if len(line.split()) == 2)
    assert float(rows["circular_accuracy"]) == 0.0
    assert 0 <= float(rows["accuracy"]) <= 0.7
    run_block("bash", "", AFTER, tmp_path)
