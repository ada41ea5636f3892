"""Questions as a taskset of `verifiers` 0.4, for reinforcement learning: `pip install verifiers`.

Put this file where Python finds it, and name it as the taskset: `--env.taskset.id iqtt_verifiers`.
Its shapes are those of training alone.
"""

import base64
import itertools
from collections.abc import Iterator

import verifiers.v1 as vf

from iqtt.environment import question
from iqtt.vlm.pictures import png
from iqtt.vlm.reading import LETTERS, read_answer


class IqttConfig(vf.TasksetConfig):
    """Settings, as those of `iqtt.environment.question`."""

    seed: int = 0
    kind: str = "matched"
    cubes: tuple[int, int] = (8, 11)
    angle: tuple[float, float] = (30.0, 180.0)
    answers: int = 3
    size: int = 256


class IqttData(vf.TaskData):
    """A question: the right letter, and how hard it is, from 0 to 1."""

    answer: str
    difficulty: float


class IqttTask(vf.Task[IqttData]):
    """A question, and its reward."""

    @vf.reward
    async def right(self, trace: vf.Trace) -> float:
        """Return 1.0 where the last reply gives the right letter, else 0.0."""
        answer = read_answer(trace.last_reply).answer
        return float(answer is not None and LETTERS[answer] == self.data.answer)


class IqttTaskset(vf.Taskset[IqttTask, IqttConfig]):
    """Questions without end; `take(n)` gives the first n."""

    INFINITE = True

    def load(self) -> Iterator[IqttTask]:
        """Yield a task for each index from 0."""
        settings = {name: getattr(self.config, name) for name in SETTINGS}
        for index in itertools.count():
            made = question(index=index, **settings)
            picture = base64.b64encode(png(made.image)).decode()
            content = [
                {"type": "image_url", "image_url": {"url": f"data:image/png;base64,{picture}"}},
                {"type": "text", "text": made.prompt},
            ]
            data = IqttData(
                name=f"{made.kind}-{made.seed}-{made.index}",
                prompt=[vf.UserMessage(content=content)],
                answer=made.answer,
                difficulty=made.difficulty,
            )
            yield IqttTask(data, self.config.task)


SETTINGS = ("seed", "kind", "cubes", "angle", "answers", "size")
__all__ = ["IqttTaskset"]
