"""Questions about furnished rooms: settings, what is drawn, and what files say of it."""

import json

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from perspective_splits import SETTINGS

import cli
from iqtt.files.reader import QuestionsFile
from iqtt.perspective.rooms import LEAST_SHARE, LEAST_SHOWN, draw_question, make_rooms, room_rows
from iqtt.perspective.specs import PerspectiveSpec, perspective_spec, split_spec
from iqtt.questions.specs import SplitSpec
from iqtt.questions.views import Tally
from iqtt.render import render_question
from scenegen.common.errors import PlacementError, SpecError


@pytest.fixture(scope="module")
def table(rooms_folder):
    with QuestionsFile(
        rooms_folder / "iqtt-test.h5", None, rooms_folder / "iqtt-test-answers.h5"
    ) as opened:
        yield opened


@pytest.fixture(scope="module")
def rooms():
    return make_rooms(
        perspective_spec("perspective", train=2, val=2, test=3, **SETTINGS, with_depth=True)
    )


def test_settings_are_told_apart_by_their_json():
    rooms, cubes = perspective_spec("perspective", seed=7), SplitSpec(seed=7)
    assert split_spec(rooms.to_json()) == rooms
    assert split_spec(cubes.to_json().encode()) == cubes


@pytest.mark.parametrize(
    ("settings", "name"),
    [
        ({"angle": (10, 60)}, "angle"),
        ({"angle": (60, 121)}, "angle"),
        ({"height": 32}, "size"),
        ({"objects": (0, 5)}, "objects"),
        ({"distractors": "matched"}, "distractors"),
        ({"distractors": "swapped"}, "distractors"),
        ({"distractors": "moved", "answers": 2}, "answers"),
        ({"answers": 2}, "answers"),
        ({"object_split": "none"}, "object split"),
        ({"spp": 0}, "spp"),
    ],
)
def test_settings_out_of_range_are_refused(settings, name):
    with pytest.raises(SpecError) as refused:
        perspective_spec("perspective", **settings)
    assert refused.value.where == name


def test_kinds_that_share_a_seed_share_no_room():
    seeds = {
        perspective_spec("perspective", distractors=kind, seed=2**200).interior().seed
        for kind in ("moved", "turned", "mixed")
    }
    assert len(seeds) == 3


def test_options_are_drawn_without_the_answer_and_have_one_exposure(table, rooms):
    record = table[1]
    drawn = draw_question(rooms, "test", 1, Tally())
    options = [drawn.scenes[1].scene(k) for k in range(3)]
    assert tuple(options) == record.truth.scenes[1:]
    assert record.truth.scenes[0].objects == options[record.answer].objects
    assert np.ptp(record.truth.exposure[1:], axis=0).max() == 0


def test_each_question_is_made_again_alone(table, rooms):
    again = room_rows([render_question(rooms, "test", 2)])
    for name in ("questions", "exposure", "visible_pixels", "whole_pixels", "in_play", "depth"):
        np.testing.assert_array_equal(table.read(name, 2), again[name][0])


def test_what_is_in_play_shows_in_every_image(table):
    least = LEAST_SHOWN * 48 * 48
    for record in table:
        assert (record.truth.visible_pixels >= least).all()
        assert (record.truth.visible_pixels >= LEAST_SHARE * record.truth.whole_pixels).all()
        assert 20 <= record.truth.angle_degrees <= 60
        kinds = set(record.truth.distractor_kind) - {None}
        assert len(kinds) == 1
        assert record.truth.distractor_kind[record.answer] is None


def test_depth_is_that_of_the_scenes(table):
    truth = table[0].truth
    assert truth.depth.shape == (4, 48, 48)
    assert np.isfinite(truth.depth).mean() > 0.8  # windows are open
    assert 0.3 < np.nanmin(truth.depth) < np.nanmax(truth.depth) < 10


def test_public_files_tell_no_scene(rooms_folder):
    with h5py.File(rooms_folder / "iqtt-test.h5") as file:
        assert set(file) == {"questions"}
        assert json.loads(file.attrs["spec"])["seed"] is None


def test_too_full_a_request_is_given_up(monkeypatch):
    monkeypatch.setattr("iqtt.perspective.rooms.ATTEMPTS", 1)
    monkeypatch.setattr("iqtt.perspective.rooms.draw_alternatives", lambda *a: iter(()))
    tally = Tally()
    with pytest.raises(PlacementError):
        draw_question(make_rooms(PerspectiveSpec(**SETTINGS)), "val", 0, tally)
    assert (tally.proposed, tally.refused) == (1, 1)


@pytest.mark.parametrize(
    "options",
    [
        ["--preset", "perspective", "--cubes", "8"],
        ["--preset", "perspective", "--lights", "2"],
        ["--preset", "perspective", "--distractors", "near"],
        ["--preset", "perspective-suite", "--distractors", "moved"],
        ["--angle", "30-60"],
        ["--objects", "12"],
    ],
)
def test_options_of_other_presets_are_refused_in_one_line(options, tmp_path):
    words = ["make-split", *options, "--out", str(tmp_path / "split")]
    done = CliRunner().invoke(cli.iqtt, words)
    assert done.exit_code == 2
    assert done.output.count("\n") == 1
    assert not (tmp_path / "split").exists()
