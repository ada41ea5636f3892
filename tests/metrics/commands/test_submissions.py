"""The bench commands as a user types them, and one line for every mistake."""

import json
import shutil

import numpy as np
import pytest
from click.testing import CliRunner

import cli
from metrics.score_file import read_scores
from metrics.submissions.reader import open_predictions
from scenegen.rooms.reader import RoomsFile


def bench(*arguments):
    result = CliRunner().invoke(cli.bench, [str(a) for a in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise AssertionError(f"a traceback: {result.exception!r}") from result.exception
    return result


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_baseline_goes_all_the_way(truths, folder):
    for name in ("oracle", "empty-room"):
        made = bench("baseline", name, "--data", truths.rooms, "--out", f"{name}.h5")
        assert made.exit_code == 0, made.output
        assert f"bench score {name}.h5" in made.stdout
        truth = ("--truth", truths.rooms)
        assert bench("validate", f"{name}.h5", *truth).stdout == f"{name}.h5: valid\n"
        outputs = ("--json", f"{name}.json", "--csv", f"{name}.csv")
        scored = bench("score", f"{name}.h5", *truth, *outputs)
        assert scored.exit_code == 0, scored.output
        assert "chamfer" in scored.stdout
        for ending in ("json", "csv"):
            assert (folder / f"{name}.{ending}").stat().st_size > 1000
    beside = ("--html", "both.html", "--compare-with", "empty-room.json")
    assert bench("score", "oracle.h5", *truth, *beside).exit_code == 0
    assert "empty-room" in (folder / "both.html").read_text()
    assert read_scores(folder / "oracle.json").metrics["chamfer"].value == 0
    compared = bench(
        "compare", "empty-room.json", "oracle.json", "--html", "c.html", "--json", "c.json"
    )
    assert (compared.exit_code, "better" in compared.stdout) == (0, True), compared.output
    assert "better in" in (folder / "c.html").read_text()
    assert bench("compare", "empty-room.h5", "oracle.h5", *truth).stdout == compared.stdout
    for form, word in (("markdown", "| "), ("html", "<table"), ("latex", "\\toprule")):
        ranked = bench("leaderboard", "empty-room.json", "oracle.json", "--format", form)
        assert (ranked.exit_code, word in ranked.stdout) == (0, True), ranked.output
        assert ranked.stdout.index("oracle") < ranked.stdout.index("empty-room")
    assert "| " in bench("score", "oracle.h5", "--markdown").stdout


def test_scores_of_another_truth_do_not_stand_beside(truths, folder, check_refusal):
    bench("baseline", "chance", "--data", truths.iqtt, "--out", "chance.h5")
    bench("baseline", "oracle", "--data", truths.rooms, "--out", "oracle.h5")
    bench("score", "oracle.h5", "--json", "oracle.json")
    for options, word in ((["--html", "x.html"], "iqtt"), ([], "--html")):
        told = bench("score", "chance.h5", *options, "--compare-with", "oracle.json")
        check_refusal(told.exit_code, told.stdout, told.stderr, (word,))
    assert not (folder / "x.html").exists()


def test_a_page_that_cannot_be_made_loses_no_score(truths, folder, monkeypatch):
    def fails(*_):
        raise OSError(5, "cannot be read", "rooms.h5")

    bench("baseline", "oracle", "--data", truths.rooms, "--out", "b.h5")
    monkeypatch.setattr("metrics.views.report.html_report", fails)
    told = bench("score", "b.h5", "--json", "b.json", "--html", "b.html")
    assert told.exit_code == 2
    assert (folder / "b.json").exists()
    assert "chamfer" in told.stdout
    assert not (folder / "b.html").exists()
    other = (folder / "b.json").read_text()
    digest = json.loads(other)["meta"]["truth_digest"]
    (folder / "other.json").write_text(other.replace(digest, "0" * 64))
    beside = ("--html", "c.html", "--json", "c.json", "--compare-with", "other.json")
    assert bench("score", "b.h5", *beside).exit_code == 2
    assert not (folder / "c.json").exists(), "refused before anything is scored"


def test_pictures_of_another_split_are_left_out(truths, folder):
    bench("baseline", "chance", "--data", truths.iqtt, "--out", "chance.h5")
    shutil.copy(truths.iqtt.with_name("iqtt-test-answers.h5"), folder / "q-test-answers.h5")
    shutil.copy(truths.iqtt.with_name("iqtt-val.h5"), folder / "q-test.h5")
    given = ("--truth", "q-test-answers.h5", "--html", "p.html")
    assert bench("score", "chance.h5", *given).exit_code == 0
    assert "data:image/webp" not in (folder / "p.html").read_text()


@pytest.mark.parametrize("option", ["--json", "--csv", "--html"])
def test_scores_never_replace_the_truth_that_a_submission_names(
    truths, folder, check_refusal, option
):
    shutil.copy(truths.rooms, "rooms.h5")
    assert bench("baseline", "oracle", "--data", "rooms.h5", "--out", "p.h5").exit_code == 0
    before = (folder / "rooms.h5").read_bytes()
    result = bench("score", "p.h5", option, "rooms.h5", "--overwrite")
    check_refusal(result.exit_code, result.stdout, result.stderr, ("rooms.h5", "not an input"))
    assert (folder / "rooms.h5").read_bytes() == before


def test_what_is_viewed(truths, folder, check_refusal):
    pytest.importorskip("rerun")
    from recordings import recorded
    from submissions import good_answers, good_rooms

    path = good_rooms(folder, truths.rooms)
    (folder / "s.json").write_text("{}")
    truth = ("--truth", truths.rooms)
    for arguments, words in (
        ((good_answers(folder, truths.iqtt),), ("responses to iqtt",)),
        ((path, "--truth", "none.h5"), ("none.h5", "no file")),
        ((path, "--truth", truths.iqtt), (truths.iqtt.name,)),
        ((path, *truth, "--items", "2,9"), ("--items", "row 9")),
        ((path, *truth, "--scores", "s.json"), ("s.json",)),
    ):
        result = bench("view", *arguments)
        check_refusal(result.exit_code, result.stdout, result.stderr, words)
    assert bench("view", path, *truth, "--out", "x.rrd").exit_code == 0
    assert len(recorded("x.rrd", "scene")["/about"]) > 1


@pytest.fixture
def home(truths, tmp_path):
    """A folder with the true depth of each row, as metres in a file, and its truth's path."""
    (tmp_path / "mine").mkdir()
    with RoomsFile(truths.rooms) as rooms:
        for room in rooms:
            np.save(tmp_path / "mine" / f"{room.index}.npy", room.depth)
    return tmp_path


def test_a_folder_is_imported_and_scored(home, truths):
    out = home / "p.h5"
    done = bench("import", "--depth", home / "mine", "--data", truths.rooms, "--out", out)
    assert done.exit_code == 0, done.output
    with open_predictions(out) as found:
        assert found.method == "mine"
    assert bench("score", out, "--truth", truths.rooms).exit_code == 0
    done = bench("import", "--depth", home / "mine", "--scale", "1000", "--data", truths.rooms,
                 "--out", out, "--overwrite")  # fmt: skip
    assert (done.exit_code, "millimetres" in done.stderr) == (0, True)


def test_answers_are_imported(truths, tmp_path):
    (tmp_path / "a.json").write_text(json.dumps(list("ABCCBA")))
    out = tmp_path / "a.h5"
    done = bench("import", "--responses", tmp_path / "a.json", "--data", truths.iqtt, "--out", out)
    assert done.exit_code == 0, done.output
    with open_predictions(out) as found:
        assert (found.answers.tolist(), found.method) == ([0, 1, 2, 2, 1, 0], "a")


MODEL = """
import numpy as np
def infer(image):
    print("looking")
    return {"depth_metric": np.full(image.shape[:2], 1.5)}
"""


def test_a_model_is_run(truths, tmp_path, capfd):
    (tmp_path / "wall.py").write_text(MODEL)
    out = tmp_path / "p.h5"
    done = bench("run", tmp_path / "wall.py", "--data", truths.rooms, "--out", out)
    assert done.exit_code == 0, done.output
    assert "looking" in capfd.readouterr().err  # of its process, which has no other output
    assert "looking" not in done.stdout
    with open_predictions(out) as found:
        assert found.method == "wall"


def test_an_error_of_the_model_is_one_line_unless_all_is_asked_for(truths, tmp_path):
    (tmp_path / "wall.py").write_text(MODEL.replace("1.5", "1 / 0"))
    line = ["run", tmp_path / "wall.py", "--data", truths.rooms, "--out", tmp_path / "p.h5"]
    done = bench(*line)
    assert (done.exit_code, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert "line 5: row 0" in done.stderr
    assert "Traceback" in bench(*line, "--traceback").stderr
    assert [path.name for path in tmp_path.iterdir() if path.suffix] == ["wall.py"]


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("score nothing.h5", "nothing.h5"),
        ("compare a.py", "a.py"),
        ("leaderboard wall.py", "wall.py"),
        ("baseline oracle --data nothing.h5 --out p.h5", "nothing.h5"),
        ("import --data ROOMS --out p.h5", "--depth"),
        ("import --depth mine --responses mine --data ROOMS --out p.h5", "--depth"),
        ("import --depth mine --unit mm --scale 2 --data ROOMS --out p.h5", "--unit"),
        ("import --depth mine --scale 1/0 --data ROOMS --out p.h5", "1/0"),
        ("import --depth mine/0.npy mine/1.npy --data ROOMS --out p.h5", "mine/1.npy"),
        ("import --depth mine/[0-6].npy --data ROOMS --out p.h5", "7"),
        ("run mine --data ROOMS --out p.h5", "mine"),
        ("run wall.py --key depth --data ROOMS --out p.h5", "--key"),
        ("run wall.py --intrinsics --data ROOMS --out p.h5", "--intrinsics"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(line, word, home, truths, monkeypatch):
    """What the library refuses is tested with it: here is what only a command can meet."""
    monkeypatch.chdir(home)
    (home / "wall.py").write_text(MODEL)
    done = bench(*line.replace("ROOMS", str(truths.rooms)).split())
    assert (done.exit_code, done.stdout) == (2, ""), done.output
    assert word in done.stderr.splitlines()[-1]
    assert {path.name for path in home.iterdir()} <= {"mine", "wall.py", "__pycache__"}
