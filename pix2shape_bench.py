"""Mental-rotation questions as tasks of Inspect, which finds this file by its entry point.

    inspect eval pix2shape_bench/questions -T path=iqtt-test.h5 --model openai/NAME
    inspect eval pix2shape_bench/iqtt -T path=val-vlm --model openai/NAME

`bench ask` runs `questions`. Inspect names a task after the package that holds it, so this file has
the project's name.
"""

import base64
from collections.abc import Callable, Iterable, Mapping, Sequence
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
from iqtt.vlm.export import row_facts
from iqtt.vlm.prompt import SIZE
from iqtt.vlm.reading import ENDINGS
from iqtt.vlm.rows import Asked, Layout, vlm_rows


@task
def questions(
    path: str,
    part: str | None = None,
    answers: str | None = None,
    with_answers: bool = False,
    layout: Layout = "composed",
    rotations: int = 1,
    size: int = SIZE,
    control: bool = False,
    items: Sequence[int | str] | int | None = None,
) -> Task:
    """Ask the questions of a file, such as iqtt-test.h5; their pictures are drawn now.

    Args:
        path, part, answers, with_answers, layout, rotations, size, items: as in `Asked`.
        control: asks the questions without their references.
    """
    chosen = None
    if items is not None:  # `-T items=3` is a number, `-T items=0,3` a list of texts
        chosen = [int(item) for item in ([items] if isinstance(items, int) else items)]
    asked = Asked(
        path, part, answers, with_answers, layout, rotations, size,
        with_reference=not control, items=chosen,
    )  # fmt: skip
    return _task(_sample(row_facts(row), row.sent) for row in vlm_rows(asked))


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
        raise ValueError(f"{path}: no questions of distractor type {kind!r}")
    return _task(_sample_of_folder(row, layout) for row in rows[: limit or None])


def _task(samples: Iterable[Sample]) -> Task:
    """Return the task of these samples. Nothing is scored where the answers are withheld."""
    dataset = MemoryDataset(list(samples), name="iqtt")
    told = all(sample.target for sample in dataset)
    return Task(dataset=dataset, solver=generate(), scorer=letter() if told else None)


def _sample_of_folder(row: Mapping[str, Any], layout: str) -> Sample:
    pictures = [row["image"]] if layout == "composed" else row["images"]
    facts = {name: value for name, value in row.items() if name not in ("image", "images")}
    return _sample(facts, [picture["bytes"] for picture in pictures])


def _sample(facts: Mapping[str, Any], pictures: Sequence[bytes]) -> Sample:
    content: list[Content] = [ContentImage(image=_url(picture)) for picture in pictures]
    content.append(ContentText(text=facts["question"]))
    told = "answer" in facts
    bucket = {"angle_bin": f"angle {int(facts['angle'] // 30) * 30}"} if told else {}
    return Sample(
        input=[ChatMessageUser(content=content)],
        target=facts["answer"] if told else "",
        id=facts["id"],
        metadata={**facts, **bucket},
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
