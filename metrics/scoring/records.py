"""The scores of one method on one test set, as records; `metrics.score_file` reads and writes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from numpy.typing import NDArray

FORMAT_NAME = "pix2shape-bench/scores"
FORMAT_VERSION = "1.0"
LONGEST_NAME = 200  # characters of method, run and fingerprint
LONGEST_TEXT = 10_000
Task = Literal["rooms", "iqtt"]
Groups = Mapping[str, Mapping[str, "Score"]]
# Columns of `ScoreFile.items` that identify each entry; no two entries share the first one.
ID_COLUMNS = {"rooms": ("row", "scene_index", "view_index"), "iqtt": ("question",)}
OPTIONAL_COLUMNS = {"rooms": ("view_angle_degrees",), "iqtt": ()}
GROUPINGS = {
    "rooms": ("by_view_angle",),
    "iqtt": ("by_distractor", "by_rotation_angle", "by_position"),
}


@dataclass(frozen=True)
class Score:
    """A score with its interval.

    Attributes:
        value: mean over views within a scene, then over scenes; or over questions.
        low, high: ends of the interval at `Meta.confidence`; None where there is none.
        unit: of all of them.
        n: scenes, or questions, that it rests on.
        std: standard deviation over training runs (n - 1 in the denominator); None for one run.
    """

    value: float
    low: float | None
    high: float | None
    unit: str
    n: int
    std: float | None = None


@dataclass(frozen=True)
class Submission:
    """A file that was scored: one training run."""

    path: str
    sha256: str
    run: str = ""


@dataclass(frozen=True)
class Meta:
    """Where scores come from.

    Attributes:
        truth_fingerprint: of the test set; never empty. Where the truth file has none (the released
            3D-IQTT), SHA-256 of its answers.
        truth_path: where the truth lay.
        submissions: one for each training run.
        writer: the program and its release.
        versions: releases of the libraries that computed the scores, by package.
        seed, resamples: of the bootstrap; 0 resamples where intervals come by formula.
        confidence: of all intervals, between 0 and 1.
        counts: such as the number of rows, scenes, runs.
        warnings: for a person, such as why the scores are not comparable.
        chamfer_floor: Chamfer distance between two samples of the true surface at this
            resolution, scene units; None where it was not measured.
    """

    truth_fingerprint: str
    truth_path: str
    submissions: tuple[Submission, ...]
    writer: str
    versions: Mapping[str, str]
    seed: int
    resamples: int
    confidence: float
    counts: Mapping[str, int]
    warnings: tuple[str, ...] = ()
    chamfer_floor: float | None = None


@dataclass(frozen=True, eq=False)
class ScoreFile:
    """All scores of one method on one test set.

    Attributes:
        task: "rooms" or "iqtt".
        method: its name; any text.
        comparable: whether all of the test set was scored, and nothing penalised.
        alignment: what the method says it cannot know; "none" for questions.
        metrics: by name, see `metric_names`.
        items: columns of equal length with an entry for each image or question: the integers of
            `ID_COLUMNS`, maybe those of `OPTIONAL_COLUMNS` (-1 where not known), and float64 by
            name of the metric, means over the runs.
        by_view_angle: scores by whole degrees between a view and its scene's first one, such as
            "35"; rooms only.
        by_distractor: by kind of wrong answers; questions only, as are the next two.
        by_rotation_angle: by range of degrees, such as "30-60".
        by_position: by index of the right answer, "0" to "2".
        path: where it was read from; no part of the content.
    """

    task: Task
    method: str
    comparable: bool
    alignment: str
    metrics: Mapping[str, Score]
    items: Mapping[str, NDArray[Any]]
    meta: Meta
    by_view_angle: Groups = field(default_factory=dict)
    by_distractor: Groups = field(default_factory=dict)
    by_rotation_angle: Groups = field(default_factory=dict)
    by_position: Groups = field(default_factory=dict)
    path: Path | None = None

    @property
    def runs(self) -> int:
        """The number of training runs over which the scores are means."""
        return len(self.meta.submissions)

    @property
    def ids(self) -> NDArray[Any]:
        """The row of the truth, or the question, that each entry of the columns is about, (N,)."""
        return self.items[ID_COLUMNS[self.task][0]]

    @property
    def clusters(self) -> NDArray[Any]:
        """The scene of each image, whose errors are correlated; each question by itself, (N,)."""
        return self.items["scene_index" if self.task == "rooms" else "question"]

    @property
    def place(self) -> str:
        """The path, or the method where there is none, to begin an error with."""
        return str(self.path) if self.path is not None else self.method
