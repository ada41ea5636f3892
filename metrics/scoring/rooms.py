"""Submissions of rooms -> scores."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.statistics import bootstrap_interval, cluster_means
from metrics.scoring.metric_names import metric
from metrics.scoring.records import Score, ScoreFile
from metrics.scoring.room_rows import RoomScores, ScoringError, score_rows
from metrics.scoring.runs import (
    CONFIDENCE,
    Progress,
    Settings,
    known,
    matched_rows,
    meta_of,
    refuse,
    warnings_of,
)
from metrics.submissions.missing_rows import size_problems
from metrics.submissions.reader import RoomPredictions
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]


def score_rooms(
    files: Sequence[RoomPredictions], truth_path: Path, settings: Settings, progress: Progress
) -> ScoreFile:
    """As `scoring.score`, for runs on a rooms file."""
    with RoomsFile(truth_path) as truth:
        count, fingerprint = len(truth), truth.fingerprint
        for file in files:
            refuse(file.path, size_problems(file, truth))
    rows, whole = matched_rows(files, truth_path, fingerprint, count, settings.allow_partial)
    for file in files:
        if file.has_normals != files[0].has_normals:
            raise ScoringError(f"{file.path}: normal: some runs have normals, others have none")
    scored = score_rows(
        [file.path for file in files],
        truth_path,
        rows,
        files[0].alignment,
        non_finite=settings.non_finite,
        processes=settings.processes,
        progress=progress,
    )
    metrics = _estimates(scored, np.ones(len(rows), bool), settings)
    angles = np.unique(scored.view_angle_degrees).tolist()
    by_angle = {}
    if len(np.unique(scored.view_index)) > 1:
        for angle in [angle for angle in angles if angle >= 0]:
            some = scored.view_angle_degrees == angle
            by_angle[str(angle)] = _estimates(scored, some, settings)
    warnings = warnings_of(whole, len(rows), count, scored.penalised)
    items = {"row": rows, "scene_index": scored.scene_index, "view_index": scored.view_index}
    items["view_angle_degrees"] = scored.view_angle_degrees
    items |= {name: runs.mean(axis=0) for name, runs in scored.scores.items()}
    counts = {
        "rows": len(rows),
        "rows_in_truth": count,
        "scenes": len(np.unique(scored.scene_index)),
        "runs": len(files),
        "rows_penalised": len(scored.penalised),
    }
    floor = scored.floor if np.isfinite(scored.floor) else None
    return ScoreFile(
        task="rooms",
        method=files[0].method,
        comparable=not warnings,
        alignment=files[0].alignment,
        metrics=metrics,
        by_view_angle=by_angle,
        items=items,
        meta=meta_of(files, truth_path, fingerprint, settings, counts, warnings, floor),
    )


def _estimates(scored: RoomScores, some: Array, settings: Settings) -> dict[str, Score]:
    """Return every score of some items: views averaged within scenes, then scenes."""
    scene = scored.scene_index[some]
    names = list(scored.scores)
    runs = np.stack([scored.scores[name][:, some] for name in names], axis=-1)  # (R, M, K)
    means = cluster_means(runs.mean(axis=0), scene)
    low, high = bootstrap_interval(means, settings.seed, settings.resamples, CONFIDENCE)
    value = means.mean(axis=0)
    each = np.stack([cluster_means(run, scene).mean(axis=0) for run in runs])
    return {
        name: Score(
            float(value[k]),
            known(low[k]),
            known(high[k]),
            metric(name).unit,
            len(means),
            float(each[:, k].std(ddof=1)) if len(each) > 1 else None,
        )
        for k, name in enumerate(names)
    }
