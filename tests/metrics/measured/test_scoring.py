"""Measured truth is scored, compared and ranked; rooms and other protocols stay apart."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest

from metrics.measured.protocols import ProtocolError
from metrics.measured.reader import MeasuredFile
from metrics.score_file import read_scores, write_scores
from metrics.scoring.evaluate import open_runs, score, score_protocols, score_runs
from metrics.scoring.runs import ScoringError, Settings
from metrics.scoring.truth_digests import OtherTruthError
from metrics.submissions.problems import JsonError
from metrics.submissions.validation import validate
from metrics.submissions.writer import RoomPredictionWriter
from metrics.viewing import predicted_scenes
from metrics.views.compare.compare import compare
from metrics.views.leaderboard import rankings
from metrics.views.protocols import protocols_report
from metrics.views.report import html_report
from scenegen.rooms.reader import RoomsFile


def noisy(depth, rng):
    return depth * (1.0 + 0.1 * rng.standard_normal(depth.shape))


def test_scores_are_means_over_images_at_the_measured_pixels(measured, predicted, tmp_path):
    truth = measured(normals=True)
    path = predicted(truth, noisy)
    scores = score([path], truth)
    expected = []
    with h5py.File(truth) as file, h5py.File(path) as said:
        for row, (height, width) in enumerate(file["size"][()]):
            t = file["depth"][row, :height, :width].astype(float)
            p = said["depth"][row, :height, :width].astype(float)
            known = np.isfinite(t)
            expected.append(np.mean(np.abs(p - t)[known] / t[known]))
            assert scores.columns["pixels"][row] == known.sum()
    assert scores.columns["abs_rel"][0] == pytest.approx(expected, rel=1e-12)
    assert scores.metrics["abs_rel"].value == pytest.approx(np.mean(expected), rel=1e-12)
    assert (scores.metrics["abs_rel"].n, scores.unit, scores.protocol) == (6, "groups", "declared")
    assert {"boundary_f1", "abs_rel_after_scale_shift_l1"} <= set(scores.metrics)
    write_scores(scores, tmp_path / "s.json")
    again = read_scores(tmp_path / "s.json")
    assert again.metrics == scores.metrics
    assert again.protocol == "declared"
    assert not validate(path, truth)


def test_floors_are_guesses_that_see_no_picture(measured, predicted):
    """Under a scale and a shift: the mean depth, and the best line over rows that comes nearer."""
    truth = measured()
    found = score([predicted(truth, noisy)], truth, Settings(protocol="affine-depth"))
    with h5py.File(truth) as file:
        for row, (height, width) in enumerate(file["size"][()]):
            t = file["depth"][row, :height, :width].astype(float)
            down, _ = np.nonzero(np.isfinite(t))
            t = t[np.isfinite(t)]
            slope, middle = np.polyfit(down, t, 1)
            line = middle + slope * down if slope < 0 else t.mean()
            for guess, fitted in (("flat", t.mean()), ("ramp", line)):
                expected = np.sqrt(np.mean((fitted - t) ** 2))
                assert found.items[f"{guess}_rmse"][row] == pytest.approx(expected, rel=1e-9)
    perfect = score([predicted(truth, lambda d, _: d, "perfect")], truth)
    assert {s.value for s in perfect.skills.values()} == {1.0}
    flat = score(
        [predicted(truth, lambda d, _: np.ones_like(d), "flat", alignment="scale_shift")], truth
    )
    for name, skill in flat.skills.items():
        best = max if name == "delta_1" else min
        guesses = {f"{guess}_{name}" for guess in ("flat", "ramp")} & flat.items.keys()
        floor = best(np.nanmean(flat.items[guess]) for guess in guesses)
        assert skill.floor == pytest.approx(floor, rel=1e-12)
        assert skill.value <= 0
    named = {"abs_rel", "delta_1", "rmse", "silog", "relative_normal_degrees"}
    assert flat.skills.keys() == named


def test_a_mean_over_pixels_is_that_of_all_of_them(measured, predicted):
    truth = measured()
    file = score([predicted(truth, noisy)], truth)
    file = replace(file, protocol="nyu-eigen-pixels")
    weights = file.columns["pixels"] / file.columns["pixels"].sum()
    for name in ("abs_rel", "delta_1"):
        expected = weights @ file.items[name]
        assert file.metrics[name].value == pytest.approx(expected, rel=1e-12)
    expected = np.sqrt(weights @ np.square(file.items["rmse"]))
    assert file.metrics["rmse"].value == pytest.approx(expected, rel=1e-12)
    better = replace(file, columns={**file.columns, "rmse": file.columns["rmse"] * 0.5})
    difference = compare([file, better], ["rmse"]).differences[0]
    assert difference.difference == pytest.approx(-expected / 2, rel=1e-12)
    assert difference.verdict == "better" or difference.p_holm > 0.03  # six groups


def test_two_protocols_never_share_a_table(measured, predicted, tmp_path):
    truth = measured()
    a, b = predicted(truth, noisy, "a"), predicted(truth, lambda d, rng: d, "b")
    first = score([a], truth, Settings(protocol="moge"))
    second = score([b], truth, Settings(protocol="moge"))
    other = score([b], truth, Settings(protocol="affine-depth"))
    assert compare([first, second]).differences[0].difference < 0.0
    with pytest.raises(OtherTruthError):
        compare([first, other])
    assert [len(r.files) for r in rankings([first, second, other])] == [2, 1]
    with pytest.raises(OtherTruthError):
        html_report(first, beside=[other])


def test_all_protocols_that_suit_stand_in_one_table(measured, predicted):
    truth = measured()
    path = predicted(truth, noisy)
    with open_runs([path], truth) as runs:
        scores = score_protocols(runs, Settings(), lambda done: None)
    names = [file.protocol for file in scores]
    assert {"declared", "kitti-eigen-garg", "kitti-eigen-garg-median", "moge"} <= set(names)
    assert not {"nyu-eigen", "kitti-kb"} & set(names)
    for file in scores:
        alone = score([path], truth, Settings(protocol=file.protocol))
        assert alone.metrics["abs_rel"] == file.metrics["abs_rel"]
    assert all(name in protocols_report(scores) for name in names)


@pytest.mark.parametrize(
    ("how", "good", "bad"),
    [
        ({"alignment": "scale"}, "moge-scale", "kitti-eigen"),
        ({"alignment": "scale_shift"}, "affine-depth", "moge-scale"),
        ({}, "affine-disparity", "affine-depth"),
    ],
)
def test_what_a_method_cannot_know_is_not_scored(measured, predicted, how, good, bad):
    truth = measured()
    path = predicted(truth, noisy if how else lambda d, _: {"disparity": 3.0 / d + 0.1}, **how)
    assert score([path], truth, Settings(protocol=good)).metrics["delta_1"].value > 0.9
    for wrong in (bad, "no-such"):
        with pytest.raises(ProtocolError):
            score([path], truth, Settings(protocol=wrong))


def test_truth_of_twenty_points_has_depth_alone(measured, predicted):
    truth = measured(share=20 / (48 * 64))
    scores = score([predicted(truth, noisy)], truth)
    assert scores.metrics["delta_1"].value > 0.9
    names = [name for name in scores.metrics if "boundary" in name or "normal" in name]
    assert not names


def test_points_are_scored_on_the_rays_of_the_matrix(measured, predicted):
    truth = measured()
    with MeasuredFile(truth) as file:
        rays = [file.rays(row, *file.size(row)) for row in range(len(file))]
    at = iter(rays)
    path = predicted(truth, lambda d, rng: {"points": next(at) * d[..., None]})
    scores = score([path], truth)
    assert scores.metrics["points_rel"].value < 1e-6
    assert scores.metrics["points_delta_1"].value == 1.0


def test_values_that_are_not_finite_are_refused_or_penalised(measured, predicted):
    truth = measured()
    path = predicted(truth, noisy)
    with h5py.File(path, "r+") as file:
        depth = file["depth"][0]
        depth[:40, :60] = np.nan
        file["depth"][0] = depth
    with pytest.raises(ScoringError):
        score([path], truth)
    scores = score([path], truth, Settings(non_finite="penalise"))
    assert scores.columns["abs_rel"][0, 0] == 4.0
    assert scores.meta.counts["rows_penalised"] == 1


def test_a_protocol_is_for_measured_truth_alone(rooms_path, measured, predicted, tmp_path):
    path, copy = tmp_path / "r.h5", measured()
    with RoomsFile(rooms_path) as rooms, RoomPredictionWriter(path, rooms_path, method="m") as out:
        for row, room in enumerate(rooms):
            out.add(row, room.depth)
    with pytest.raises(ProtocolError):
        score([path], rooms_path, Settings(protocol="moge"))
    with pytest.raises(ScoringError):
        score([path], copy)


@pytest.mark.parametrize("edit", [{"protocol": "no-such"}, {"protocol": ""}, {"objects": {"a": 1}}])
def test_a_score_file_with_a_wrong_protocol_is_refused(measured, predicted, tmp_path, edit):
    truth, path = measured(count=4), tmp_path / "s.json"
    write_scores(score([predicted(truth, noisy)], truth), path)
    path.write_text(json.dumps(json.loads(path.read_text()) | edit))
    with pytest.raises(JsonError):
        read_scores(path)


def test_images_are_recorded_in_3d(measured, predicted, tmp_path):
    """Each a scene of its own, with points on the rays of its matrix, the worst image first."""
    pytest.importorskip("rerun")
    from recordings import points_of, recorded

    from scenegen.viewing import write_recording

    truth, worst = measured(), iter(range(12))
    path = predicted(truth, lambda d, rng: d * (1.5 if next(worst) == 7 else 1.1))
    with open_runs([path], truth) as runs:
        scores = score_runs(runs, Settings(resamples=100), lambda done: None)
        scenes = predicted_scenes(runs.files[0], runs.truth, scores)
        write_recording(tmp_path / "x.rrd", "x", scenes)
        view, picture = runs.truth.view(7), runs.truth.picture(7)
    there = recorded(tmp_path / "x.rrd", "worst AbsRel first")
    points, colors = points_of(there["/world/truth/view_0"][0])
    expected = (view.rays * view.depth[..., None])[view.mask]
    np.testing.assert_allclose(points, expected, rtol=1e-6)
    np.testing.assert_array_equal(colors[:, :3], picture[view.mask])
    points, _ = points_of(there["/world/prediction/view_0"][0])
    np.testing.assert_allclose(points, 1.5 * expected, rtol=1e-5)
