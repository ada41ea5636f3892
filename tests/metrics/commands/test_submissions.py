"""The bench commands as a user types them, and every broken submission of the corpus."""

import json
import os
import shutil

import pytest
from click.testing import CliRunner

import cli
from metrics.score_file import read_scores


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
        outputs = ("--json", f"{name}.json", "--csv", f"{name}.csv", "--html", f"{name}.html")
        scored = bench("score", f"{name}.h5", *truth, *outputs)
        assert scored.exit_code == 0, scored.output
        assert "chamfer" in scored.stdout
        for ending in ("json", "csv", "html"):
            assert (folder / f"{name}.{ending}").stat().st_size > 1000
    beside = ("--html", "both.html", "--beside", "empty-room.json")
    assert bench("score", "oracle.h5", *truth, *beside).exit_code == 0
    assert "empty-room" in (folder / "both.html").read_text()
    assert read_scores(folder / "oracle.json").metrics["chamfer"].value == 0
    compared = bench("compare", "empty-room.json", "oracle.json", "--html", "c.html")
    assert (compared.exit_code, "better" in compared.stdout) == (0, True), compared.output
    assert "better in" in (folder / "c.html").read_text()
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
        told = bench("score", "chance.h5", *options, "--beside", "oracle.json")
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
    beside = ("--html", "c.html", "--json", "c.json", "--beside", "other.json")
    assert bench("score", "b.h5", *beside).exit_code == 2
    assert not (folder / "c.json").exists(), "refused before anything is scored"


def test_pictures_of_another_split_are_left_out(truths, folder):
    bench("baseline", "chance", "--data", truths.iqtt, "--out", "chance.h5")
    shutil.copy(truths.iqtt.with_name("iqtt-test-answers.h5"), folder / "q-test-answers.h5")
    shutil.copy(truths.iqtt.with_name("iqtt-val.h5"), folder / "q-test.h5")
    given = ("--truth", "q-test-answers.h5", "--html", "p.html")
    assert bench("score", "chance.h5", *given).exit_code == 0
    assert "data:image/webp" not in (folder / "p.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("score nothing.h5", ("nothing.h5", "no such file")),
        ("score . ", (".",)),
        ("validate nothing.h5", ("nothing.h5", "no such file")),
        ("compare a.json", ("a.json",)),
        ("compare broken.json broken.json", ("broken.json",)),
        ("leaderboard broken.json", ("broken.json",)),
        ("baseline oracle --data nothing.h5", ("nothing.h5",)),
        ("baseline chance --data nothing.h5", ("nothing.h5",)),
    ],
)
def test_a_mistake_is_one_line(arguments, words, folder, check_refusal):
    (folder / "broken.json").write_text('{"format": ')
    result = bench(*arguments.split())
    check_refusal(result.exit_code, result.stdout, result.stderr, words)
    assert sorted(os.listdir(folder)) == ["broken.json"]


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
        ((good_answers(folder, truths.iqtt),), ("answers to iqtt",)),
        ((path, "--truth", "none.h5"), ("none.h5", "no file")),
        ((path, "--truth", truths.iqtt), (truths.iqtt.name,)),
        ((path, *truth, "--items", "2,9"), ("--items", "row 9")),
        ((path, *truth, "--scores", "s.json"), ("s.json",)),
    ):
        result = bench("view", *arguments)
        check_refusal(result.exit_code, result.stdout, result.stderr, words)
    assert bench("view", path, *truth, "--out", "x.rrd").exit_code == 0
    assert len(recorded("x.rrd", "scene")["/about"]) > 1
