"""Mental-rotation questions as a taskset of `verifiers` 0.4, for reinforcement learning.

    pip install verifiers
    PYTHONPATH=examples eval verifiers_taskset --env.taskset.length 100 ...

Questions are made when they are asked for, of training shapes alone.
"""

import base64
import io
from collections.abc import Iterator
from typing import Any

import verifiers.v1 as vf
from PIL import Image

from iqtt.environment import Questions


class QuestionConfig(vf.TasksetConfig):
    """What is asked; `kind` and the sizes are those of `iqtt.environment.question`."""

    length: int = 1000
    seed: int = 0
    kind: str = "matched"
    size: int = 256


class QuestionData(vf.TaskData):
    """A question as it is traced: the right letter, and how hard it is, 0 to 1."""

    answer: str
    difficulty: float


class QuestionTask(vf.Task[QuestionData]):
    """A prompt with one picture; the reward is 1 for the right letter."""

    @vf.reward
    async def right_letter(self, trace: vf.Trace) -> float:
        """Return 1.0 where the last reply gives the right letter, else 0.0."""
        entry = {"answer": self.data.answer}
        return Questions(1).score_answer(trace.last_reply, entry)


class QuestionTaskset(vf.Taskset[QuestionTask, QuestionConfig]):
    """Questions 0 to length - 1 of a seed."""

    def load(self) -> Iterator[QuestionTask]:
        """Make one question after another."""
        how = self.config
        for entry in Questions(how.length, seed=how.seed, kind=how.kind, size=how.size):
            parts = [
                {"type": "text", "text": entry["question"]},
                {"type": "image_url", "image_url": {"url": png_url(entry["images"][0])}},
            ]
            message = vf.UserMessage(content=parts)
            difficulty = entry["metadata"]["difficulty"]
            data = QuestionData(prompt=[message], answer=entry["answer"], difficulty=difficulty)
            yield QuestionTask(data)


def png_url(pixels: Any) -> str:
    """Return a picture (H, W, 3) of bytes as a URL that holds it."""
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode()
