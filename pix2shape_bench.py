"""Mental-rotation questions as a task of Inspect: `inspect eval pix2shape_bench/iqtt -T path=DIR`.

Inspect names a task after the package that holds it, so this file has the project's name.
"""

import base64
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from inspect_ai import Task, task
from inspect_ai.dataset import MemoryDataset, Sample
from inspect_ai.model import ChatMessageUser, Content, ContentImage, ContentText
from inspect_ai.scorer import (
    Metric,
    SampleScore,
    Score,
    Scorer,
    Target,
    accuracy,
    grouped,
    metric,
    scorer,
    stderr,
)
from inspect_ai.solver import TaskState, generate

from iqtt.vlm import harness
from iqtt.vlm.reading import ENDINGS


@task
def iqtt(
    path: str, kind: str = "", layout: str = "composed", control: bool = False, limit: int = 0
) -> Task:
    """Ask the questions of a folder that `iqtt export --format vlm` wrote.

    Args:
        path: the folder.
        kind: asks only questions of this kind, such as matched.
        layout: "composed" for one picture, "separate" for one each; as the folder was written.
        control: asks the questions without their references.
        limit: asks the first so many rows; 0 asks all.
    """
    import pyarrow.parquet as pq

    name = "control.parquet" if control else "questions.parquet"
    rows = pq.read_table(Path(path) / name).to_pylist()
    rows = [row for row in rows if not kind or row.get("kind") == kind]
    if not rows:
        raise ValueError(f"{path}: no questions of the kind {kind!r}")
    if "answer" not in rows[0]:
        raise ValueError(f"{path}: the answers are withheld; ask with `bench ask`, then import")
    samples = [_sample(row, layout) for row in rows[: limit or None]]
    return Task(dataset=MemoryDataset(samples, name="iqtt"), solver=generate(), scorer=letter())


def _sample(row: dict[str, Any], layout: str) -> Sample:
    pictures = [row["image"]] if layout == "composed" else row["images"]
    content: list[Content] = [ContentImage(image=_url(picture["bytes"])) for picture in pictures]
    content.append(ContentText(text=row["question"]))
    bucket = f"angle {int(row['angle'] // 30) * 30}"
    facts = {name: value for name, value in row.items() if name not in ("image", "images")}
    return Sample(
        input=[ChatMessageUser(content=content)],
        target=row["answer"],
        id=row["id"],
        metadata={**facts, "angle_bin": bucket},
    )


def _url(png: bytes) -> str:
    return "data:image/png;base64," + base64.b64encode(png).decode()


@metric
def circular_accuracy() -> Metric:
    """Questions whose every rotation is right."""
    return _over_rows(harness.circular_accuracy)


@metric
def skill() -> Metric:
    """How much of the way from the floor to perfect."""
    return _over_rows(harness.skill)


@metric
def unparsed() -> Metric:
    """Rows without an answer."""
    return _over_rows(harness.unparsed)


def _over_rows(mean: Callable[[Sequence[harness.Answered]], float]) -> Metric:
    # Inspect goes by the annotation: a function without it gets scores of another type.
    def of_scores(scores: list[SampleScore]) -> float:
        return mean([score.score.metadata or {} for score in scores])

    return of_scores


@scorer(
    metrics=[
        accuracy(),
        stderr(cluster="shape"),
        circular_accuracy(),
        skill(),
        unparsed(),
        grouped(accuracy(), "kind", all=False),
        grouped(accuracy(), "angle_bin", all=False),
    ]
)
def letter() -> Scorer:
    """Score the letter that the model's text gives; see `iqtt.vlm.reading`."""

    async def score(state: TaskState, target: Target) -> Score:  # noqa: ARG001
        output = state.output
        ended = "refusal" if output.error else "" if output.empty else output.stop_reason
        row = harness.answered(state.metadata, output.completion, ENDINGS.get(ended))
        return Score(
            value=row["score"],
            answer=row["letter"],
            explanation=state.output.completion,
            metadata=row,
        )

    return score
