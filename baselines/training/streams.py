"""Streams to learn from, in place of files. Blocks of their rows are read as open files are.

They begin beyond the last scene that a file can have, so that whoever trains on a stream has seen
no scene of any file, whatever the seed. Built-in objects are those of the training split.
"""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import iqtt
from baselines.training.data import refuse_request
from iqtt import QuestionStream, SplitSpec
from iqtt.questions.kinds import DISTRACTORS
from iqtt.questions.specs import MAX_QUESTIONS
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

    def shown(self, size: int, seed: int, **more: Any) -> "Shown":
        """Return the streams of a run.

        Args:
            size: of images, pixels.
            seed: of the run, and of its rooms or questions.
            more: further settings of the requests.

        Raises SpecError, also for the seed and the objects of a named test set.
        """
        specs: list[Any] = []
        given = {"height": size, "width": size, "seed": seed, **more}
        for name in self.names.split(","):
            if self.hold_questions:
                specs.append(iqtt.preset_spec("small", distractors=name, **given))
                continue
            families = PRESETS[name].settings.get("source") == "families"
            split = {"object_split": "train"} if families else {}
            specs.append(preset_spec(name, **split, **given))
            if not self.allow_test_set:
                refuse_request(self.where, specs[-1].to_json())
        if len({getattr(spec, "interior", False) for spec in specs}) > 1:
            raise SpecError("stream", self.names, "only closed rooms, or none")
        return Shown(tuple(specs))


@dataclass(frozen=True)
class Shown:
    """Streams of these requests."""

    specs: tuple[Any, ...]

    def whole(self, batch: int) -> int:
        """Return how many rows are shown for a batch: of whole scenes, so perhaps more."""
        views = len(getattr(self.specs[0], "view_angles", (0,)))
        return -(-batch // views) * views

    def card(self) -> dict[str, Any]:
        """Return what a card tells: the requests, with their seeds, and what tells them apart."""
        data = "\n".join(spec.to_json() for spec in self.specs)
        return {"data": data, "fingerprint": hashlib.sha256(f"stream\n{data}".encode()).hexdigest()}

    def blocks(self, before: int, rows: int, workers: int) -> Iterator["Block"]:
        """Yield blocks of so many rows without end, rendered by `workers`.

        Args:
            before: rows that were shown before.
        """
        requests = dict.fromkeys(self.specs, 1.0)
        how: dict[str, Any] = {"batch": rows, "workers": workers}
        if isinstance(self.specs[0], SplitSpec):
            fields = QUESTION_FIELDS + ["depth"] * self.specs[0].with_depth
            how |= {"fields": fields, "start": MAX_QUESTIONS + before}
            stream: Any = QuestionStream(requests, **how)
        else:
            first = MAX_COUNT * len(self.specs[0].view_angles)
            fields = ROOM_FIELDS + ["room/size"] * self.specs[0].interior
            stream = RoomStream(requests, fields=fields, start=first + before, **how)
        mark = self.card()["fingerprint"]
        for values in stream:
            yield Block("stream", self.specs[0], mark, values)


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
