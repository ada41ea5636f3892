"""Submissions against truths: what is averaged over what, and what is refused."""

import hashlib
import json
import os
import shutil
import warnings
from unittest.mock import Mock

import h5py
import numpy as np
import pytest
from h5_edits import put, replaced, told_again
from refusals import refused
from submissions import good_answers, good_rooms
from threadpoolctl import threadpool_info, threadpool_limits

from baselines.trivial import write_room_baseline
from metrics.prediction_writer import RoomPredictionWriter, write_answers
from metrics.score_file import read_scores, to_json, write_scores
from metrics.scoring import known_tests, rooms
from metrics.scoring.evaluate import score
from metrics.scoring.images import rows as module
from metrics.scoring.known_tests import KnownTest
from metrics.scoring.metric_names import OTHER_SCENE, SKILLED, metric
from metrics.scoring.rooms import view_angles
from metrics.scoring.runs import ScoringError, Settings
from metrics.submissions.reader import open_predictions
from metrics.submissions.validation import validate
from scenegen.camera import Camera
from scenegen.common.errors import FileFormatError
from scenegen.files.pool import LostWorkerError
from scenegen.layout import SCORED, TRUTH_DIGEST
from scenegen.rooms.reader import RoomsFile


@pytest.fixture(scope="session")
def folder(tmp_path_factory, rooms_path):
    """Rooms (8 of them), and submissions for them."""
    made = tmp_path_factory.mktemp("scoring")
    shutil.copy(rooms_path, made / "rooms.h5")
    for name in ("oracle", "empty-room"):
        write_room_baseline(name, made / "rooms.h5", made / f"{name}.h5")
    rng = np.random.default_rng(0)
    with RoomsFile(made / "rooms.h5") as rooms:
        for run in range(3):
            path = made / f"noisy-{run}.h5"
            with RoomPredictionWriter(path, made / "rooms.h5", method="noisy", run=f"{run}") as out:
                for row in rng.permutation(len(rooms)).tolist():
                    out.add(row, rooms[row].depth * rng.uniform(0.9, 1.1, rooms[row].depth.shape))
    return made


def test_the_truth_is_perfect(folder):
    found = score([folder / "oracle.h5"], folder / "rooms.h5")
    assert found.comparable
    for name, value in found.metrics.items():
        best = 1.0 if metric(name).higher_is_better else 0.0
        # Boundaries lack directions, and SAWA-H counts them.
        if not name.startswith(OTHER_SCENE) and name not in ("boundary_f1", "sawa_h"):
            assert value.value == pytest.approx(best, abs=1e-10), name
    for name, skill in found.skills.items():
        # Of shares, eight scenes do not show more.
        low = skill.low if name in ("relief_iou", "delta_1") else 1.0
        if name != "boundary_f1":
            assert (skill.value, skill.low, skill.high) == (1.0, low, 1.0)
    assert found.metrics["relief_iou"].low == pytest.approx(8 / (8 + 1.959964**2))
    assert found.skills["relief_iou"].low < found.metrics["relief_iou"].low
    # Of several views, of other tasks, of methods that state how sure they are, of layers, and one
    # in which a constant is perfect.
    others = {"behind_depth_error", "rmse", "silog", "ause_abs_rel", "delta_1", "solid_iou"}
    assert set(found.skills) == set(SKILLED) - others
    assert {"normal_mean_degrees", "derived_normal_mean_degrees"} <= set(found.metrics)
    for scores in (*found.by_object_shape.values(), *found.by_object_size.values()):
        for name, value in scores.items():
            assert value.value == (1.0 if metric(name).higher_is_better else 0.0)


def test_runs_are_averaged_image_by_image(folder):
    paths = [folder / f"noisy-{run}.h5" for run in range(3)]
    found, alone = score(paths), [score([path]).metrics["paper_chamfer"] for path in paths]
    each = np.array([score([path]).items["paper_chamfer"] for path in paths])
    got = found.metrics["paper_chamfer"]
    assert found.items["paper_chamfer"] == pytest.approx(each.mean(axis=0), rel=1e-12)
    assert got.value == pytest.approx(each.mean(), rel=1e-12)
    assert got.std == pytest.approx(np.std([one.value for one in alone], ddof=1), rel=1e-9)
    assert (got.n, alone[0].std) == (8, None)
    assert got.low < got.value < got.high
    assert [one.run for one in found.meta.submissions] == ["0", "1", "2"]


def test_processes_change_no_digit_and_scores_read_back(folder, tmp_path):
    paths = [folder / "empty-room.h5"]
    one, two = (to_json(score(paths, settings=Settings(processes=n))) for n in (1, 2))
    assert one == two
    found = score(paths)
    assert found.metrics["chamfer"].value > 0.005
    write_scores(found, tmp_path / "x.json")
    assert to_json(read_scores(tmp_path / "x.json")) == one


def test_views_are_averaged_within_scenes_and_told_by_angle(folder, tmp_path):
    """Rows 0 to 3 become one scene seen from 0, 35, -35 and 80 degrees; the others stay."""
    truth = tmp_path / "rooms.h5"
    shutil.copy(folder / "rooms.h5", truth)
    with h5py.File(truth, "r+") as file:
        file["scene_index"][:4] = 0
        file["view_index"][:4] = np.arange(4)
        for row, degrees in enumerate((10, 45, -25, 90)):
            azimuth = np.radians(degrees)
            position = 3 * np.array([np.sin(azimuth), 0.5, np.cos(azimuth)])
            camera = Camera(tuple(position.tolist()), (0.0, 0.0, 0.0), 20.0)
            file["camera/world_from_camera"][row] = camera.world_from_camera
        told_again(file)
    found = score([folder / "noisy-0.h5"], truth)
    items = np.asarray(found.items["mse_depth"])
    assert np.asarray(found.items["view_angle_degrees"])[:4].tolist() == [0, 35, -35, 80]
    value = np.mean([items[:4].mean(), *items[4:]])
    assert found.metrics["mse_depth"].value == pytest.approx(value)
    assert found.metrics["mse_depth"].n == 5
    assert set(found.by_view_angle) == {"0", "35", "80"}
    assert found.by_view_angle["35"]["mse_depth"].value == pytest.approx(items[1:3].mean())
    assert found.by_view_angle["35"]["mse_depth"].low is None


def test_view_angles_go_the_short_way_round_and_tell_which():
    """From +z towards +x is counter-clockwise, as seen from above."""

    def matrix(degrees):
        turned = np.eye(4)
        turned[:3, 2] = [np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))]
        return turned

    cameras = np.stack([matrix(d) for d in (170, -170, 80, -10, -9.6, 5)])
    found = view_angles(np.array([0] * 5 + [7]), np.array([0, 1, 2, 3, 4, 1]), cameras)
    assert found[:5].tolist() == [0, 20, -90, 180, 180]
    assert np.isnan(found[5])


def test_missing_rows_are_refused_or_stamped(folder, tmp_path):
    path = tmp_path / "part.h5"
    truth = folder / "rooms.h5"
    with (
        RoomsFile(truth) as rooms,
        RoomPredictionWriter(path, truth, method="part", allow_partial=True) as out,
    ):
        for row in (1, 4, 6):
            out.add(row, rooms[row].depth)
    with refused(ScoringError, f"{path}: row", found="5 of 8 missing", hint="--allow-partial"):
        score([path])
    found = score([path], truth, Settings(allow_partial=True))
    assert not found.comparable
    assert found.items["row"].tolist() == [1, 4, 6]
    assert "3 of 8" in found.warnings[0]


@pytest.mark.parametrize(
    "bad", [np.nan, -4e38, *(pytest.param(x, marks=pytest.mark.slow) for x in (np.inf, 9e99))]
)
def test_what_is_not_finite_is_refused_with_its_rows_or_penalised(folder, tmp_path, bad):
    path = tmp_path / "bad.h5"
    shutil.copy(folder / "oracle.h5", path)
    with h5py.File(path, "r+") as file:
        replaced("depth", np.float64)(file)
        file["depth"][5, 3, 7] = bad
        row = int(file["row"][5])
    with refused(ScoringError, f"{path}: row {row}: predicted depth", hint="--non-finite penalise"):
        score([path])
    truth = folder / "rooms.h5"
    (problem,) = validate(path, truth)
    assert (problem.dataset, problem.rule, problem.ids) == ("depth", "finite", (row,))
    found = score([path], truth, Settings(non_finite="penalise"))
    assert not found.comparable
    assert found.meta.counts["rows_penalised"] == 1
    assert found.items["mse_depth"][row] == metric("mse_depth").worst()
    assert np.count_nonzero(found.items["mse_depth"]) == 1


def test_only_runs_of_one_method_are_averaged(folder):
    with refused(ScoringError, "oracle.h5: method", hint="bench compare"):
        score([folder / "empty-room.h5", folder / "oracle.h5"])
    with refused(ScoringError, expected="each submission once"):
        score([folder / "oracle.h5", folder / "oracle.h5"])


def test_runs_must_have_something_in_common(folder, tmp_path):
    """Normals in all of them or in none, and some rows."""
    truth, paths = folder / "rooms.h5", {}
    with RoomsFile(truth) as rooms:
        for name, rows, normals in (("a", (0, 1), True), ("b", (0, 1), False), ("c", (2,), False)):
            paths[name] = tmp_path / f"{name}.h5"
            with RoomPredictionWriter(
                paths[name], truth, method="m", run=name, allow_partial=True
            ) as out:
                for row in rows:
                    out.add(row, rooms[row].depth, rooms[row].normal if normals else None)
    for first, second, where in (("a", "b", "b.h5: normal"), ("b", "c", "b.h5")):
        with refused(ScoringError, f"{tmp_path}/{where}"):
            score([paths[first], paths[second]], settings=Settings(allow_partial=True))


def copied(source, path, **attributes):
    """The same predictions in a file of other bytes."""
    shutil.copy(source, path)
    with h5py.File(path, "r+") as file:
        for name in ("row", "depth", "normal"):
            if name in file:
                replaced(name, lambda values: values[::-1])(file)
        file.attrs.update(attributes)
    return path


@pytest.mark.parametrize(("back", "processes"), [(False, 1), (True, 1), (True, 2)])
def test_a_submission_that_changes_while_it_is_scored(
    truths, tmp_path, monkeypatch, back, processes
):
    """Another file gets its name after it was opened; at the end the first has it again, or not.

    One process reads the file that it opened; others open it again.
    """
    mine, other = tmp_path / "mine.h5", tmp_path / "other.h5"
    write_room_baseline("empty-room", truths.rooms, mine)
    write_room_baseline("oracle", truths.rooms, other)
    monkeypatch.setattr("metrics.scoring.images.rows.CHUNK", 2)
    real = rooms.score_rows

    def swapped(files, *rest):
        os.rename(mine, tmp_path / "kept")
        os.rename(other, mine)
        found = real(files, *rest)
        if back:
            os.rename(tmp_path / "kept", mine)
        return found

    before = score([mine], truths.rooms).metrics
    monkeypatch.setattr(rooms, "score_rows", swapped)
    if back and processes == 1:
        assert score([mine], truths.rooms, Settings(processes=1)).metrics == before
        return
    with refused(FileFormatError, str(mine), found="another file"):
        score([mine], truths.rooms, Settings(processes=processes))


def test_two_copies_of_one_run_are_not_two_runs(folder, questions, tmp_path):
    """Whatever their bytes, names and order of rows; nor are answers that lost their scores."""
    first = folder / "noisy-0.h5"
    copy = copied(first, tmp_path / "copy.h5", run="another", notes="really")
    with refused(ScoringError, "copy.h5", found="noisy-0.h5", expected="once"):
        score([folder / "noisy-1.h5", first, copy])
    answers = questions / "split/iqtt-test-answers.h5"
    given = np.random.default_rng(0).random((2, 30, 3)).argsort(axis=-1)
    paths = [tmp_path / f"{name}.h5" for name in "ab"]
    for path, scores in zip(paths, (given[0], 2.0 * given[0]), strict=True):
        write_answers(path, answers, method="m", scores=scores.astype(float))
    (tmp_path / "c.json").write_text(
        json.dumps({"answers": given[0].argmax(axis=1).tolist(), "method": "m"})
    )
    assert score(paths, answers).runs == 2  # which differ by scores alone
    with refused(ScoringError, "c.json", found="a.h5"):
        score([paths[0], tmp_path / "c.json"], answers)


def test_the_largest_depth_that_may_be_is_scored(folder, tmp_path):
    """With neither a warning nor a number that is not finite, intervals included."""
    path = tmp_path / "large.h5"
    shutil.copy(folder / "noisy-0.h5", path)
    with h5py.File(path, "r+") as file:
        file["depth"][...] = np.finfo("f4").max
        file["depth"][1, ::2] *= -1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = score([path], folder / "rooms.h5")
    assert found.comparable
    for one in found.metrics.values():
        assert np.isfinite([one.value, one.low, one.high]).all()


@pytest.fixture
def truth(truths, tmp_path):
    """A copy of the rooms that a test may change, and a good submission for it."""
    shutil.copy(truths.rooms, tmp_path / "truth.h5")
    good_rooms(tmp_path, tmp_path / "truth.h5")
    return tmp_path / "truth.h5"


@pytest.fixture
def answers(truths, tmp_path):
    """The same of questions."""
    beside = truths.iqtt.with_name("iqtt-test-answers.h5")
    shutil.copy(beside, tmp_path / "truth.h5")
    good_answers(tmp_path, truths.iqtt)
    return tmp_path / "truth.h5"


def by_hand(file, names, group=""):
    """The digest as docs/rooms-file.md tells it, with plain h5py."""
    lines = []
    for name in sorted(names):
        values = file[f"{group}{name}" if name != "answers" else name]
        rows = b"".join(hashlib.sha256(row.tobytes()).digest() for row in values)
        lines.append(f"{name} {hashlib.sha256(rows).hexdigest()}\n")
    return hashlib.sha256("".join(lines).encode()).hexdigest()


@pytest.mark.parametrize("processes", [1, 2])
def test_scores_name_the_digest_of_the_rooms_that_were_read(truth, processes):
    meta = score([truth.with_name("predictions.h5")], truth, Settings(processes=processes)).meta
    with h5py.File(truth) as file:
        assert meta.truth_digest == file.attrs[TRUTH_DIGEST] == by_hand(file, SCORED[:-3])
    assert meta.truth_source == "given"


def test_rows_that_are_not_scored_count_too(truth, tmp_path):
    path = tmp_path / "part.h5"
    with (
        RoomsFile(truth) as rooms,
        RoomPredictionWriter(path, truth, method="part", allow_partial=True) as out,
    ):
        out.add(3, rooms.read("depth", 3))
        stored = rooms.attributes[TRUTH_DIGEST]
    partial = Settings(allow_partial=True)
    assert score([path], truth, partial).meta.truth_digest == stored
    with h5py.File(truth, "r+") as file:
        put("normal", (5, 0, 0), (0.0, 0.6, 0.8))(file)
    with refused(ScoringError, f"{truth}: {TRUTH_DIGEST}", hint="normal"):
        score([path], truth, partial)


def test_scores_name_the_digest_of_the_answers_that_were_read(answers):
    meta = score([answers.with_name("answers.h5")], answers).meta
    with h5py.File(answers) as file:
        names = ("answers", "distractor_kind", "angle_degrees")
        assert meta.truth_digest == by_hand(file, names, "truth/") == file.attrs[TRUTH_DIGEST]


SOME = {"depth": 2.0, "normal": (0.0, 0.6, 0.8), "object_id": 7}


@pytest.mark.parametrize("name", SCORED[:-3])  # `test_layers` has layers
def test_changed_rooms_are_refused(name, truth):
    path = truth.with_name("predictions.h5")
    with h5py.File(truth, "r+") as file:
        if name in SOME:
            put(name, (5, 0, 0), SOME[name])(file)
        else:
            change = np.nextafter if file[name].dtype.kind == "f" else np.add
            put(name, 5, change(file[name][5], 9))(file)
            put(name, (5, 3), (0, 0, 0, 1))(file) if name.endswith("from_camera") else None
    with refused(ScoringError, f"{truth}: {TRUTH_DIGEST}", hint=f": {name}"):
        score([path], truth)


def test_changed_answers_are_refused(answers):
    path = answers.with_name("answers.h5")
    with h5py.File(answers, "r+") as file:
        file["truth/angle_degrees"][3] += 1.0
    with refused(ScoringError, f"{answers}: {TRUTH_DIGEST}", hint="angle_degrees"):
        score([path], answers)


def test_kinds_of_wrong_answers_belong_to_wrong_answers(answers):
    with h5py.File(answers, "r+") as file:
        file["truth/distractor_kind"][3] = -1
    with refused(FileFormatError, f"{answers}: distractor_kind, row 3"):
        score([answers.with_name("answers.h5")], answers)


def test_a_truth_that_only_the_submission_names_is_not_comparable(truth, monkeypatch):
    """Forged depth under the true fingerprint, say, and a submission that fits it."""
    path = truth.with_name("predictions.h5")
    found = score([path])
    digest = found.meta.truth_digest
    assert (found.comparable, found.meta.truth_source) == (False, "submission")
    (warning,) = found.warnings
    assert all(word in warning for word in (str(truth), digest[:12], "--truth"))
    assert score([path], truth).comparable
    known = KnownTest("mine", "rooms", digest, 8, "scenegen render")
    monkeypatch.setattr(known_tests, "KNOWN_TESTS", (known,))
    found = score([path])
    assert (found.comparable, found.meta.truth_source, found.warnings) == (True, "known", ())
    assert score([path], truth).meta.truth_source == "given"


def test_how_values_are_packed_does_not_matter(truth):
    before = score([truth.with_name("predictions.h5")], truth).meta.truth_digest
    with h5py.File(truth, "r+") as file:
        replaced("depth", lambda values: values)(file)
    assert score([truth.with_name("predictions.h5")], truth).meta.truth_digest == before


def test_a_killed_worker_is_an_error_of_the_submission(folder, monkeypatch):
    """As Linux does where memory is short; how that is found out is in `test_workers`."""
    lost = LostWorkerError("rows 0 to 7", "signal 9, SIGKILL", hint="with --workers 1")
    monkeypatch.setattr(module, "in_processes", Mock(side_effect=lost))
    monkeypatch.setattr(module, "CHUNK", 2)
    path = folder / "oracle.h5"
    with refused(ScoringError, str(path), found="SIGKILL", hint="--processes 1"):
        score([path], folder / "rooms.h5", Settings(processes=2))


def threads():
    return {library["filepath"]: library["num_threads"] for library in threadpool_info()}


@pytest.mark.parametrize("processes", [None, 1])
@threadpool_limits.wrap(limits=2)
def test_small_products_use_one_thread(tmp_path, rooms_path, monkeypatch, processes):
    """Of OpenBLAS and the like, which would let others spin beside them; and as before after it."""
    write_room_baseline("oracle", rooms_path, tmp_path / "oracle.h5")
    before, found, score = threads(), [], module.RowScorer.score

    def watched(self, triples):
        found.extend(threads().values())
        return score(self, triples)

    monkeypatch.setattr(module.RowScorer, "score", watched)
    with open_predictions(tmp_path / "oracle.h5") as file, RoomsFile(rooms_path) as rooms:
        module.score_rows([file], rooms, np.arange(4), Settings(processes=processes))
    assert set(found) == {1}
    assert {path: count for path, count in threads().items() if path in before} == before
