"""Streams to learn from, in place of files. Blocks of their rows are read as open files are.

They begin beyond the last scene that a file can have, so that whoever trains on a stream has seen
no scene of any file, whatever the seed. Built-in objects are those of the training split.
"""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import iqtt
from baselines.training.test_sets import refuse_request
from iqtt import QuestionStream, SplitSpec
from iqtt.questions.specs import DISTRACTORS, MAX_QUESTIONS
from scenegen import RoomStream, preset_spec
from scenegen.common.errors import SpecError
from scenegen.common.names import check_choice
from scenegen.description.presets import PRESETS
from scenegen.layout import FIELDS
from scenegen.rooms.make import MAX_COUNT

ROOM_FIELDS = [c.name for c in FIELDS if c.dtype != "text" and c.name != "normal"]
QUESTION_FIELDS = ["questions", "answers", "camera_distance", "light_position", "light_color"]
NEIGHBOURS = {"views": tuple(range(0, 90, 10)), "image_dtype": "float16"}  # views to be matched


@dataclass(frozen=True)
class TrainingStreams:
    """What somebody wants to learn from: presets of rooms, or kinds of questions, equally often.

    Attributes:
        names: of presets or kinds, separated by commas.
        allow_test_set: whether a named test set may be shown.
    """

    names: str
    allow_test_set: bool = False

    @property
    def hold_questions(self) -> bool:
        """Whether they are questions. Raises SpecError for unknown names, and rooms beside them."""
        kinds = set()
        for name in self.names.split(","):
            check_choice("stream", name, [*PRESETS, *DISTRACTORS])
            kinds.add(name in DISTRACTORS)
        if len(kinds) > 1:
            raise SpecError("stream", self.names, "rooms or questions, not both")
        return kinds.pop()

    @property
    def where(self) -> str:
        """Their names, for messages."""
        return f"stream {self.names}"

    def shown(self, settings: Any, batch: int, workers: int, **more: Any) -> "Shown":
        """Return what a run is shown: `batch` images or questions in an iteration, or some more.

        Args:
            settings: of the run, with `size` and `seed`.
            workers: processes that render.
            more: settings of the requests.

        Raises SpecError, also for the seed and the objects of a named test set.
        """
        specs: list[Any] = []
        size = {"height": settings.size, "width": settings.size, "seed": settings.seed}
        for name in self.names.split(","):
            if self.hold_questions:
                specs.append(iqtt.preset_spec("small", distractors=name, **size, **more))
                continue
            families = PRESETS[name].settings.get("source") == "families"
            split = {"object_split": "train"} if families else {}
            specs.append(preset_spec(name, **{**size, **split, **more}))
            if not self.allow_test_set:
                refuse_request(self.where, specs[-1].to_json())
        together = 1 if self.hold_questions else len(specs[0].views)
        return Shown(tuple(specs), -(-batch // together) * together, workers)


@dataclass(frozen=True)
class Shown:
    """Streams of these requests, in batches of some rows."""

    specs: tuple[Any, ...]
    batch: int
    workers: int

    def card(self) -> dict[str, Any]:
        """Return what a card tells: the requests, with their seeds, and what tells them apart."""
        data = "\n".join(spec.to_json() for spec in self.specs)
        return {"data": data, "fingerprint": hashlib.sha256(f"stream\n{data}".encode()).hexdigest()}

    def blocks(self, batches: int, rows: int = 0, **share: int) -> Iterator["Block"]:
        """Yield the rows of batch after batch, without end.

        Args:
            batches: that were shown before, by all processes that train.
            rows: of a batch of this process, if they are others.
            share: `rank` and `world_size`, where they are not those of torch.
        """
        requests = dict.fromkeys(self.specs, 1.0)
        how: dict[str, Any] = {"batch": rows or self.batch, "workers": self.workers, **share}
        if isinstance(self.specs[0], SplitSpec):
            start = MAX_QUESTIONS + batches * self.batch
            fields = QUESTION_FIELDS + ["depth"] * self.specs[0].with_depth
            stream: Any = QuestionStream(requests, fields=fields, start=start, **how)
        else:
            start = MAX_COUNT * len(self.specs[0].views) + batches * self.batch
            stream = RoomStream(requests, fields=ROOM_FIELDS, start=start, **how)
        for values in stream:
            yield Block("stream", self.specs[0], self.card()["fingerprint"], values)


@dataclass(frozen=True, eq=False)
class Block:
    """Some rows of a stream, as readers take them from an open file."""

    path: str
    spec: Any
    fingerprint: str
    values: Mapping[str, Any]
    has_truth = True
    has_answers = False  # nobody labels questions of a stream

    def __len__(self) -> int:
        return len(next(iter(self.values.values())))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.spec, name)  # height, width and answers

    @property
    def fields(self) -> tuple[str, ...]:
        """The names that `read` takes."""
        return tuple(self.values)

    def read(self, name: str, rows: int | slice) -> Any:
        """Return rows of a column."""
        return self.values[name][rows]
