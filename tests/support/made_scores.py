"""Score files for tests, made in memory."""

from dataclasses import replace

import numpy as np

from metrics.score_file import Meta, Score, ScoreFile, Submission
from metrics.scoring.metric_names import OF_TRUTH, metric
from metrics.scoring.records import GROUPINGS, AnswerGroup

TRUTH = "0123456789abcdef" * 4
DIGEST = "fedcba9876543210" * 4
HEADLINE = ("chamfer", "hausdorff", "mse_depth")
FOLLOWING = {"items", "metrics", "skills", "comparable"}.union(*GROUPINGS.values())


def stated(file, **numbers):
    """The file with other numbers than those that follow from its items, such as skills."""
    assert numbers.keys() <= FOLLOWING
    other = replace(file)
    vars(other).update(numbers)
    return other


def make_meta(method, runs=1, truth=TRUTH, digest=DIGEST, **other):
    number = f"{sum(map(ord, method)) * 1000:x}"
    submissions = tuple(
        Submission(f"{method}-{i}.h5", f"{number}{i:x}".rjust(64, "0"), f"seed {i}")
        for i in range(runs)
    )
    fields = {"truth_path": "rooms.h5", "writer": "bench 0.2.0", "truth_digest": digest}
    fields |= {"versions": {"numpy": "2.4.6", "h5py": "3.12"}, "truth_given": True}
    fields |= {"seed": 0, "resamples": 2000}
    return Meta(truth_fingerprint=truth, submissions=submissions, **{**fields, **other})


def make_score(name, value, n=2):
    """A score without an interval."""
    return Score(value, None, None, metric(name).unit, n, None)


def rooms_scores(method, columns, scenes, runs=1, rows=None, **other):
    """Rooms with these columns of scores, (N,) or (runs, N), by name; scene labels (N,).

    `other` are numbers that follow, parts of `Meta`, and what else a score file has.
    """
    count = len(scenes)
    views = [list(scenes[:i]).count(scene) for i, scene in enumerate(scenes)]
    rows = np.arange(count) if rows is None else np.asarray(rows)
    items = {"row": rows, "scene_index": np.asarray(scenes), "view_index": np.array(views)}
    for name, column in columns.items():
        values = np.asarray(column, np.float64)
        shape = values.shape if name.startswith(OF_TRUTH) else (runs, count)
        items[name] = np.broadcast_to(values, shape)
    numbers = {name: other.pop(name) for name in FOLLOWING & other.keys()}
    own = {name: other.pop(name) for name in {"object_columns", "path"} & other.keys()}
    alignment = other.pop("alignment", "none")
    counts = {"rows_in_truth": int(rows.max()) + 1, "rows_penalised": 0, "pixels": 4096}
    meta = make_meta(method, runs, **{"counts": counts, **other})
    return stated(ScoreFile("rooms", method, alignment, items, meta, **own), **numbers)


def rooms_with_objects(method="mine", runs=1, **other):
    """Four rows of two scenes, of which the last shows no object, with skills."""
    nan = float("nan")
    columns = {"chamfer": [0.1, 0.3, 0.2, 0.2], "empty_room_chamfer": [0.5, 0.3, 0.2, 0.2]}
    objects = {"row": [0, 0, 1, 2], "object": [1, 2, 1, 3], "pixels": [20, 60, 16, 30]}
    objects |= {"object_depth_error": [0.2, 0.4, 0.1, 0.3]}
    objects |= {"object_completeness": [0.01, 0.03, 0.06, 0.2]}
    objects |= {"object_recall_0.02": [1.0, 0, 0, 0], "object_recall_0.05": [1.0, 1, 0, 0]}
    whole = ("row", "object", "pixels")
    objects = {n: np.array(c if n in whole else [c] * runs) for n, c in objects.items()}
    objects["shape"] = np.array(["box", "cone", "box", "torus"], object)
    columns |= {"object_depth_error": [0.35, 0.1, 0.3, nan]}
    columns |= {"object_completeness": [0.025, 0.06, 0.2, nan]}
    columns |= {"object_recall_0.02": [0.5, 0.0, 0.0, nan]}
    columns |= {"relief_correlation": [-0.5, 0.5, -0.25, nan], "relief_iou": [0.1, 0.2, 0.3, nan]}
    return rooms_scores(method, columns, [0, 0, 1, 1], runs, object_columns=objects, **other)


def iqtt_scores(method, right, runs=1, questions=None, kinds=None, shapes=None, **other):
    """Questions with these right answers, (runs, Q), or means over the runs (Q,), of `kinds`."""
    values = np.asarray(right, np.float64)
    if values.ndim == 1:
        values = (np.arange(runs)[:, None] < np.rint(runs * values)).astype(np.float64)
    ids = np.arange(values.shape[-1]) if questions is None else np.asarray(questions)
    kinds = np.array(["mirror"] * len(ids) if kinds is None else kinds)
    groups = {
        kind: AnswerGroup(
            int((kinds == kind).sum()),
            tuple(int(run[kinds == kind].sum()) for run in values),
            None,
            None,
        )
        for kind in sorted(set(kinds.tolist()))
    }
    items = {"question": ids, "iqtt_accuracy": values}
    items |= {} if shapes is None else {"shape": np.asarray(shapes)}
    numbers = {name: other.pop(name) for name in FOLLOWING & other.keys()}
    counts = {"questions_in_truth": int(ids.max()) + 1, "answers": 3, "abstained": 0}
    told = {"counts": counts | other.pop("counts", {}), "resamples": 2000 if runs > 1 else 0}
    meta = make_meta(method, runs, **{**told, **other})
    groups = {"by_distractor": groups}
    return stated(ScoreFile("iqtt", method, "none", items, meta, answer_groups=groups), **numbers)


def simple_rooms(method="mine", **other):
    """Two scenes of two views each."""
    columns = {
        "chamfer": [0.1, 0.3, 0.2, 0.2],
        "hausdorff": [0.5, 0.5, 0.25, 0.75],
        "mse_depth": [0.01, 0.02, 0.03, 1 / 3],
        "f_score_0.05": [0.5, 0.25, 1.0, 0.0],
    }
    angles = {str(angle): {"chamfer": make_score("chamfer", 0.1)} for angle in (0, 35, 5)}
    return rooms_scores(method, columns, [0, 0, 1, 1], **{"by_view_angle": angles, **other})
