"""Submissions of layers: written, read, validated and scored against ground truth with layers."""

import shutil

import h5py
import numpy as np
import pytest
from h5_edits import put
from refusals import refused

from metrics.measures.hidden.solids import length, paired_spans
from metrics.prediction_writer import RoomPredictionWriter
from metrics.scoring.evaluate import score
from metrics.scoring.metric_names import ALL
from metrics.scoring.runs import ScoringError, Settings
from metrics.submissions.problems import PredictionError
from metrics.submissions.reader import open_predictions
from metrics.submissions.validation import validate
from metrics.viewing import predicted_scenes
from metrics.views.examples import examples_of
from scenegen.layout import SCORED
from scenegen.rooms.reader import RoomsFile

SETTINGS = Settings(processes=1)
SOLID = [name for name, metric in ALL.items() if metric.of == "layers"]


@pytest.fixture(scope="module")
def layered(make_rooms, tmp_path_factory):
    """Four rooms, with an open teapot in one."""
    path = tmp_path_factory.mktemp("layered") / "rooms.h5"
    shapes = ("sphere", "box", "torus", "teapot")
    return make_rooms(path, 4, height=40, width=48, objects=(1, 2), seed=3, truth=("layers",),
                      shapes=shapes, object_radius=(0.2, 0.3), min_visible_pixels=20)  # fmt: skip


def write(path, truth, change=lambda layers: layers, **settings):
    with (
        RoomsFile(truth) as rooms,
        RoomPredictionWriter(path, truth, method="m", **settings) as out,
    ):
        for row in range(len(rooms)):
            out.add(row, layers=change(rooms.read("layers/depth", row).astype(np.float64)))
    return path


def test_the_truth_is_perfect(layered, tmp_path):
    path = write(tmp_path / "p.h5", layered)
    assert [problem for problem in validate(path, layered) if not problem.is_hint] == []
    found = score([path], layered, SETTINGS)
    assert set(found.metrics) <= set(SOLID)
    values = {name: one.value for name, one in found.metrics.items()}
    assert values["solid_iou"] == values["layer_recall_0.02"] == 1.0
    assert max(values[n] for n in ("back_depth_error", "seen_chamfer", "unseen_chamfer")) < 1e-7
    assert found.skills["solid_iou"].value == 1.0
    assert found.skills["solid_iou"].floor_name == "inflated_mask_solid_iou"


@pytest.mark.parametrize(
    ("alignment", "change", "best"),
    [
        ("none", lambda x: 2 * x, False),
        ("scale", lambda x: 2 * x, True),
        ("scale", lambda x: 2 * x + 1, False),
        ("scale_shift", lambda x: 2 * x + 1, True),
    ],
)
def test_only_what_is_declared_is_fitted(alignment, change, best, layered, tmp_path):
    path = write(tmp_path / "p.h5", layered, change, alignment=alignment)
    assert (score([path], layered, SETTINGS).metrics["solid_iou"].value > 0.999) == best


def test_the_room_does_not_change_the_fit(layered, tmp_path):
    """Of which there are rays with one layer."""

    def farther(layers):
        return layers * np.where(np.isnan(layers[..., 1:2]), 3.0, 2.0)

    path = write(tmp_path / "p.h5", layered, farther, alignment="scale")
    assert score([path], layered, SETTINGS).metrics["solid_iou"].value > 0.999


def test_hidden_layers_do_not_change_the_fit(layered, tmp_path):
    """Twice as deep behind the first layer, which alone is fitted."""

    def deeper(layers):
        return layers[..., :1] + 2 * (layers - layers[..., :1])

    values = [
        score([write(tmp_path / f"{a}.h5", layered, deeper, alignment=a)], layered, SETTINGS)
        for a in ("none", "scale")
    ]
    a, b = (one.columns["solid_iou"] for one in values)
    np.testing.assert_allclose(a, b, atol=1e-6)
    assert np.nanmax(a) < 0.9


def test_thickness_is_what_is_scored(layered, tmp_path):
    """Against integrals of this test's own: half of each solid is there."""
    path = write(tmp_path / "p.h5", layered, lambda x: np.where(
        np.arange(16) == 1, (x[..., :1] + x) / 2, x))  # fmt: skip
    found = score([path], layered, SETTINGS)
    with RoomsFile(layered) as rooms, open_predictions(path) as said:
        for row, value in enumerate(found.columns["solid_iou"].ravel()):
            kinds = rooms.read("layers/entering", row)
            opened = ((rooms.read("layers/object_id", row) > 0) & (kinds == 0)).any(axis=-1)
            true, mine = (
                paired_spans(layers[~opened].T.astype(float))
                for layers in (
                    rooms.read("layers/depth", row),
                    said.geometry(row),
                )
            )
            lengths = [length(spans).sum() for spans in (mine, true)]
            if np.isfinite(value):  # rays hardly diverge, so that lengths weigh alike
                assert value == pytest.approx(lengths[0] / lengths[1], abs=0.01)


def write_depth(path, truth):
    with RoomsFile(truth) as rooms, RoomPredictionWriter(path, truth, method="m") as out:
        for row in range(len(rooms)):
            out.add(row, rooms.read("depth", row))
    return path


def test_depth_has_no_scores_of_solids(layered, tmp_path):
    path = write_depth(tmp_path / "d.h5", layered)
    assert not set(score([path], layered, SETTINGS).metrics) & set(SOLID)


def test_points_of_whole_surfaces_belong_to_layers_and_are_finite(layered, tmp_path):
    out = RoomPredictionWriter(tmp_path / "d.h5", layered, method="m")
    with refused(PredictionError, where="row 0: surface_points"), out:
        out.add(0, np.ones((40, 48)), surface_points=np.ones((5, 3)))

    def written(path, value):
        out = RoomPredictionWriter(path, layered, method="m", allow_partial=True)
        with RoomsFile(layered) as rooms, out:
            out.add(0, layers=rooms.read("layers/depth", 0), surface_points=np.full((5, 3), value))
        return path

    with refused(PredictionError, where="row 0: surface_points"):
        written(tmp_path / "p.h5", np.nan)
    path = written(tmp_path / "p.h5", -1.0)
    partial = Settings(processes=1, allow_partial=True, non_finite="penalise")
    values = score([path], layered, partial).metrics
    assert values["whole_chamfer"].value > values["whole_chamfer_noise"].value > 0
    with h5py.File(path, "r+") as file:
        file["surface_points"][0, 2] = np.inf
        file["layers"][0, 0, 0, 0] = np.inf
    assert ("surface_points", "finite") in {(p.dataset, p.rule) for p in validate(path, layered)}
    assert score([path], layered, partial).metrics["whole_chamfer"].value == 4.0


@pytest.mark.parametrize("name", SCORED[-3:])
def test_changed_layers_are_refused(name, layered, tmp_path):
    """Of all rows, in submissions of layers and of depth."""
    paths = write(tmp_path / "p.h5", layered), write_depth(tmp_path / "d.h5", layered)
    shutil.copyfile(layered, changed := tmp_path / "changed.h5")
    with h5py.File(changed, "r+") as file:
        assert [score([path], layered, SETTINGS).meta.truth_digest for path in paths] == [
            file.attrs["truth_digest"]
        ] * 2
        put(name, (3, 9, 9, 15), 1)(file)
    for path in paths:
        with refused(ScoringError, hint=name):
            score([path], changed, SETTINGS)


@pytest.mark.parametrize(
    ("value", "rule"), [(np.inf, "range"), (-1.0, "range"), (0.0, "range"), (0.01, "order")]
)
def test_bad_layers_are_refused(value, rule, layered, tmp_path):
    def spoilt(layers):
        layers[3, 5, 1:] = np.nan
        layers[3, 5, 1] = value
        return layers

    with refused(PredictionError):
        write(tmp_path / "p.h5", layered, spoilt)
    path = write(tmp_path / "q.h5", layered)
    with h5py.File(path, "r+") as file:
        for row in range(4):
            file["layers"][row] = spoilt(file["layers"][row])
    assert ("layers", rule) in {(p.dataset, p.rule) for p in validate(path, layered)}
    with refused(ScoringError):
        score([path], layered, SETTINGS)
    worst = score([path], layered, Settings(processes=1, non_finite="penalise"))
    assert worst.metrics["solid_iou"].value == 0.0


def test_gaps_between_layers_and_other_numbers_of_them_are_refused(layered, tmp_path):
    def gap(layers):
        layers[0, 0, :2] = np.nan, 1.0
        return layers

    with refused(PredictionError):
        write(tmp_path / "p.h5", layered, gap)
    others = RoomPredictionWriter(tmp_path / "p.h5", layered, method="m")
    with refused(PredictionError, where="row 1: layers"), others as out:
        for row, count in enumerate((4, 5)):
            out.add(row, layers=np.full((40, 48, count), np.nan))


def test_rooms_without_layers_are_refused(make_rooms, layered, tmp_path):
    plain = make_rooms(tmp_path / "plain.h5", 1, height=40, width=48)
    with RoomPredictionWriter(tmp_path / "p.h5", plain, method="m") as out:
        out.add(0, layers=np.full((40, 48, 2), np.nan))
    assert ("layers", "match") in {(p.dataset, p.rule) for p in validate(tmp_path / "p.h5", plain)}
    with refused(ScoringError):
        score([tmp_path / "p.h5"], plain, SETTINGS)


def test_pages_and_the_3d_view_show_them(layered, tmp_path):
    """A page has four pictures of the first layer, and two cuts of truth and prediction each."""
    path = write(tmp_path / "p.h5", layered, lambda x: 2 * x, alignment="scale")
    scores = score([path], layered, SETTINGS)
    with RoomsFile(layered) as rooms, open_predictions(path) as said:
        examples = [one for _, some in examples_of(scores, rooms, said) for one in some]
        assert [len(one.pictures) for one in examples] == [8] * len(examples)
        views = [v for scene in predicted_scenes(said, rooms, scores) for v in scene.views]
        count = [np.isfinite(rooms.read("layers/depth", v.row)[..., 1:]).sum() for v in views]
    assert sorted(view.row for view in views) == [0, 1, 2, 3]
    for view, points in zip(views, count, strict=True):
        assert len(view.truth.hidden) == points > 0
        np.testing.assert_allclose(view.prediction.hidden, view.truth.hidden, atol=1e-3)


def test_they_are_aligned_by_least_squares_only(layered, tmp_path):
    path = write(tmp_path / "p.h5", layered, lambda x: 2 * x)
    found = score([path], layered, Settings(processes=1, align="scale"))
    assert found.metrics["solid_iou"].value > 0.999
    with refused(ScoringError):
        score([path], layered, Settings(processes=1, align="scale_l1"))
