"""The static site: which files there are, what is linked, marked and shown, and what is not."""

import re
from dataclasses import replace

import numpy as np
import pytest
from made_scores import iqtt_scores, rooms_scores, stated
from pages import Page

from iqtt.files.make import make_split
from iqtt.questions.specs import SplitSpec
from metrics.prediction_writer import RoomPredictionWriter, write_answers
from metrics.score_file import read_scores, write_scores
from metrics.scoring.evaluate import score
from metrics.views.leaderboard.gallery import spread_entries
from metrics.views.leaderboard.ranking import compared_with_first, rankings
from metrics.views.leaderboard.site import lead_of, preset_of, report_names, write_site
from scenegen.rooms.reader import RoomsFile

HOSTILE = '"><script>alert(1)</script>../../x'
SCENES = np.repeat(np.arange(10), 2)
BASE = np.random.default_rng(0).gamma(2.0, 0.1, 20)


def rooms(name, shift, **other):
    columns = {"chamfer": BASE + shift, "hausdorff": BASE, "mse_depth": BASE**2}
    return rooms_scores(name, columns, SCENES, **other)


@pytest.fixture
def files():
    noise = np.random.default_rng(1).normal(0, 0.001, 20)
    return [rooms("far", 0.3), rooms(HOSTILE, 0.0), rooms("near", noise), iqtt_scores("q", [1, 0])]


def test_a_site_has_a_page_for_each_file_and_names_stay_text(files, tmp_path):
    write_site(files, tmp_path / "site")
    pages = {path.name: Page(path.read_text()) for path in (tmp_path / "site").iterdir()}
    assert set(pages) == {"index.html", "gallery.html", *report_names(files)}
    assert all(re.fullmatch(r"[a-z0-9.-]+", name) for name in pages)
    for name, page in pages.items():
        assert page.tags.isdisjoint({"iframe", "form"})
        assert ("script" in page.tags) == (name == "index.html")
        assert {a for a in page.addresses if not a.startswith("data:")} <= set(pages)
    assert set(report_names(files)) <= set(pages["index.html"].addresses)
    assert HOSTILE in pages["index.html"].text


NEAR, FAR = rooms("near", 0.0), rooms("far", 0.3)


@pytest.mark.parametrize(
    ("files", "metrics", "words"),
    [
        ([FAR, NEAR], None, f"leads: {BASE.mean():.2f}"),
        ([NEAR], None, "alone: "),
        ([stated(NEAR, comparable=False)], None, "is not ranked: "),
        (
            [FAR, NEAR],
            ["hausdorff", "chamfer"],
            f"is one of 2 in the first place: {BASE.mean():.2f}",
        ),
    ],
)
def test_the_first_sentence_says_what_the_first_row_is(files, metrics, words):
    ((ranking,), _) = rankings(files, metrics)
    lead = lead_of(ranking)
    assert lead.text.startswith(words)
    assert ("Hausdorff" in lead.text) == bool(metrics)


def test_the_seed_of_a_withheld_truth_is_on_no_page(tmp_path):
    spec = SplitSpec(seed=987654, train=1, labeled=0, val=0, test=4, distractors="other")
    make_split(tmp_path / "split", spec, command="iqtt make-split --seed 987654")
    truth = tmp_path / "split" / "iqtt-test-answers.h5"
    write_answers(
        tmp_path / "p.h5", tmp_path / "split" / "iqtt-test.h5", method="m", answer=np.zeros(4, int)
    )
    write_site([score([tmp_path / "p.h5"], truth)], tmp_path / "site")
    pages = [path.read_text() for path in (tmp_path / "site").iterdir()]
    assert any("preset small" in page for page in pages), "the truth was at hand"
    assert not any("987654" in page for page in pages)


def test_a_path_that_cannot_be_looked_at_only_leaves_pictures_out(tmp_path):
    file = rooms("m", 0.0)
    for path in ("x" * 300 + "/rooms.h5", "rooms.h5/y" * 600):
        write_site(
            [replace(file, meta=replace(file.meta, truth_path=path))],
            tmp_path / "s",
            overwrite=True,
        )
        assert "m alone" in Page((tmp_path / "s" / "index.html").read_text()).text


def test_methods_that_are_not_told_apart_share_a_rank(files):
    (ranking, _), _ = rankings(files)
    assert {entry.label: entry.rank for entry in ranking.entries} == {
        **dict.fromkeys((HOSTILE, "near"), "1"), "far": "3",
    }  # fmt: skip
    fewer = {name: c for name, c in files[2].columns.items() if name in ("row", "scene_index")}
    comparison = compared_with_first([files[1], files[0], replace(files[2], columns=fewer)])
    assert comparison.methods == ("far",)
    assert compared_with_first([stated(files[0], comparable=False)]) is None


def test_a_site_replaces_an_older_one_and_nothing_else(files, tmp_path):
    write_site(files, tmp_path / "site")
    with pytest.raises(FileExistsError):
        write_site(files[:1], tmp_path / "site")
    write_site(files[:1], tmp_path / "site", overwrite=True)
    assert len(list((tmp_path / "site").iterdir())) == 3
    (tmp_path / "site" / "mine.txt").write_text("mine")
    with pytest.raises(FileExistsError, match=r"mine\.txt"):
        write_site(files, tmp_path / "site", overwrite=True)


def test_pictures_come_from_unchanged_files_alone(rooms_path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with (
        RoomsFile(rooms_path) as truth,
        RoomPredictionWriter("p.h5", rooms_path, method="true depth") as out,
    ):
        for row in range(len(truth)):
            out.add(row, np.nan_to_num(truth.read("depth", row), nan=1.0) + 0.1)
    write_scores(score(["p.h5"], rooms_path), "m.json")
    file = read_scores("m.json")

    def pictures(file, name):
        write_site([file], "site", overwrite=True)
        return len(Page((tmp_path / "site" / name).read_text()).pictures)

    (report,) = report_names([file])
    assert pictures(file, "gallery.html") == 6 * 3
    assert pictures(file, "index.html") == 1
    assert pictures(file, report) == 6 * 6
    assert "preset" in (tmp_path / "site" / "index.html").read_text()
    other = replace(file, meta=replace(file.meta, truth_digest="0" * 64))
    assert pictures(other, report) == 0
    with (tmp_path / "p.h5").open("ab") as changed:
        changed.write(b"x")
    assert pictures(file, "gallery.html") == pictures(file, report) == 0


def test_scenes_of_the_gallery_are_spread_and_those_that_all_predict():
    file = rooms("m", 0.0)
    spread = [int(file.clusters[i]) for i in spread_entries(file, set(range(20)))]
    assert spread == [0, 2, 4, 5, 7, 9]
    assert [int(file.ids[i]) for i in spread_entries(file, {3, 6, 7})] == [3, 6]


@pytest.mark.parametrize(
    ("command", "preset"),
    [
        ("scenegen render --n 3", "shapes"),
        ("scenegen render --preset shapenet --n 3", "shapenet"),
        ("iqtt make-split --preset=suite", "suite"),
        ("iqtt make-split --out 'it", "small"),
    ],
)
def test_presets_are_told_by_the_command(command, preset):
    assert preset_of(command) == f"preset {preset}"
