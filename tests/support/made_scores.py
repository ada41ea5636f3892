"""Score files for tests, made in memory."""

from dataclasses import replace

import numpy as np

from metrics.measures.statistics import cluster_means
from metrics.score_file import Meta, Score, ScoreFile, Skill, Submission
from metrics.scoring.metric_names import metric

TRUTH = "0123456789abcdef" * 4
DIGEST = "fedcba9876543210" * 4
HEADLINE = ("chamfer", "hausdorff", "mse_depth")


def make_meta(method, runs=1, truth=TRUTH, digest=DIGEST, **other):
    number = f"{sum(map(ord, method)) * 1000:x}"
    submissions = tuple(
        Submission(f"{method}-{i}.h5", f"{number}{i:x}".rjust(64, "0"), f"seed {i}")
        for i in range(runs)
    )
    told = {"truth_path": "rooms.h5", "writer": "bench 0.1.0", "truth_digest": digest}
    told |= {"versions": {"numpy": "2.4.6", "h5py": "3.12"}, "warnings": ()}
    told |= {"truth_source": "given", "seed": 0, "resamples": 2000, "confidence": 0.95}
    return Meta(truth_fingerprint=truth, submissions=submissions, **{**told, **other})


def make_score(name, values, clusters, std=None):
    means = cluster_means(values, clusters)
    mean = float(means.mean())
    return Score(mean, 0.9 * mean, 1.1 * mean, metric(name).unit, len(means), std)


def rooms_scores(method, columns, scenes, runs=1, rows=None, **other):
    """Rooms with these columns of scores (N,) by name; scene labels (N,)."""
    count = len(scenes)
    views = [list(scenes[:i]).count(scene) for i, scene in enumerate(scenes)]
    rows = range(count) if rows is None else rows
    items = {"row": rows, "scene_index": scenes, "view_index": views, **columns}
    std = 0.002 if runs > 1 else None
    own = {"comparable": True, "alignment": "none", "by_view_angle": {}, "path": None}
    own["skills"] = {}
    told = {name: other.pop(name, default) for name, default in own.items()}
    counts = {"rows": count, "rows_in_truth": max(rows) + 1, "scenes": len(set(scenes))}
    counts |= {"runs": runs, "rows_penalised": 0}
    return ScoreFile(
        task="rooms",
        method=method,
        metrics={name: make_score(name, column, scenes, std) for name, column in columns.items()},
        items={name: np.asarray(column) for name, column in items.items()},
        meta=make_meta(method, runs, **{"counts": counts, **other}),
        **told,
    )


def rooms_with_objects(method="mine", **other):
    """Four rows of two scenes, of which the last shows no object, with skills."""
    nan = float("nan")
    columns = {"chamfer": [0.1, 0.3, 0.2, 0.2], "empty_room_chamfer": [0.5, 0.3, 0.2, 0.2]}
    objects = {"row": [0, 0, 1, 2], "object": [1, 2, 1, 3], "pixels": [20, 60, 16, 30]}
    objects |= {"object_depth_error": [0.2, 0.4, 0.1, 0.3]}
    objects |= {"object_completeness": [0.01, 0.03, 0.06, 0.2]}
    objects |= {"object_recall_0.02": [1.0, 0, 0, 0], "object_recall_0.05": [1.0, 1, 0, 0]}
    columns |= {"object_depth_error": [0.35, 0.1, 0.3, nan]}
    columns |= {"object_completeness": [0.025, 0.06, 0.2, nan]}
    columns |= {"object_recall_0.02": [0.5, 0.0, 0.0, nan]}
    columns |= {"relief_correlation": [-0.5, 0.5, -0.25, nan], "relief_iou": [0.1, 0.2, 0.3, nan]}
    file = rooms_scores(method, {"chamfer": columns["chamfer"]}, [0, 0, 1, 1], **other)
    kept = {n: [v for v in c if v == v] for n, c in columns.items() if not n.startswith("empty")}
    counts = {**file.meta.counts, "objects": 4, "rows_without_objects": 1, "pixels": 4096}
    scores = {n: make_score(n, c, [0, 0, 1, 1][: len(c)]) for n, c in kept.items()}
    middle = scores["relief_correlation"].value
    scores["relief_correlation"] = replace(scores["relief_correlation"], low=-1.0, high=1.0)
    assert middle == -0.125
    skill = Skill(1 - 0.2 / 0.3, 0.0, 0.5, 0.3, "empty_room_chamfer")
    shapes = np.array(["box", "cone", "box", "torus"], object)
    return replace(
        file,
        metrics=scores,
        skills={"chamfer": skill},
        items={**file.items, **{n: np.array(c) for n, c in columns.items()}},
        objects={"shape": shapes, **{n: np.array(c) for n, c in objects.items()}},
        by_object_shape={"torus": {n: make_score(n, [0.2], [1]) for n in ["object_completeness"]}},
        by_object_size={"0-1": {n: make_score(n, [0.2], [1]) for n in ["object_completeness"]}},
        meta=replace(file.meta, counts=counts),
    )


def iqtt_scores(method, right, runs=1, questions=None, **other):
    """Questions with these means (Q,) of right answers over the runs."""
    values = np.asarray(right, np.float64)
    ids = np.arange(len(values)) if questions is None else np.asarray(questions)
    own = {"comparable": True, "skills": {}}
    own = {name: other.pop(name, default) for name, default in own.items()}
    group = {"mirror": {"iqtt_accuracy": Score(1 / 3, None, None, "fraction", len(values), None)}}
    counts = {"questions": len(ids), "questions_in_truth": int(ids.max()) + 1, "runs": runs}
    counts["answers"] = 3
    told = {"counts": counts, "resamples": 2000 if runs > 1 else 0}
    return ScoreFile(
        task="iqtt",
        method=method,
        alignment="none",
        metrics={"iqtt_accuracy": make_score("iqtt_accuracy", values, ids)},
        items={"question": ids, "iqtt_accuracy": values},
        meta=make_meta(method, runs, **{**told, **other}),
        by_distractor=group,
        **own,
    )


def simple_rooms(method="mine", **other):
    """Two scenes of two views each."""
    columns = {
        "chamfer": [0.1, 0.3, 0.2, 0.2],
        "hausdorff": [0.5, 0.5, 0.25, 0.75],
        "mse_depth": [0.01, 0.02, 0.03, 1 / 3],
        "f_score_0.05": [0.5, 0.25, 1.0, 0.0],
    }
    angles = {
        str(angle): {"chamfer": Score(0.1, None, None, metric("chamfer").unit, 2, None)}
        for angle in (0, 35, 5)
    }
    return rooms_scores(method, columns, [0, 0, 1, 1], by_view_angle=angles, **other)
