"""`iqtt card` and `iqtt export` as a user types them."""

import pytest
from click.testing import CliRunner

import cli

WHO = ("--creator", "A. Person")


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Run `iqtt ...` inside this process, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: CliRunner().invoke(cli.iqtt, [str(a) for a in arguments])


def test_card(run, refuses, split_folder, tmp_path):
    told = run("card", split_folder, *WHO)
    assert told.stdout == "README.md: 24 questions\n"
    assert "iqtt-test-answers.h5" not in (tmp_path / "README.md").read_text()
    refuses("card", split_folder, *WHO, words=("README.md", "--overwrite"))
    again = run("card", split_folder, *WHO, "--with-answer-key", "--title", "All", "--overwrite")
    assert again.exit_code == 0, again.output
    page = (tmp_path / "README.md").read_text()
    assert "# All" in page.splitlines()
    assert "iqtt-test-answers.h5" in page


@pytest.mark.parametrize("form", ["parquet", "webdataset"])
def test_export(form, run, refuses, split_folder, tmp_path):
    train, ending = (
        split_folder / "iqtt-train.h5",
        {"parquet": "parquet", "webdataset": "tar"}[form],
    )
    told = run("export", train, "--format", form, "--part", "labeled", "--rows-per-file", 4)
    assert told.stdout.startswith(f"iqtt-train-labeled-{form}: 6 questions in 2 files, ")
    assert sorted(path.name for path in (tmp_path / f"iqtt-train-labeled-{form}").iterdir()) == [
        "config.json", *(f"iqtt-train-labeled-0000{i}-of-00002.{ending}" for i in (0, 1))
    ]  # fmt: skip
    refuses("export", train, "--format", form, words=("labeled or unlabeled",))
    answers = split_folder / "iqtt-test-answers.h5"
    refuses("export", answers, "--format", form, words=("an answer key without images",))
