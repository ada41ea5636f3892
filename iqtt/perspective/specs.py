"""The settings of a split of questions about furnished rooms."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from iqtt.questions.kinds import ROOM_KINDS, QuestionKind
from iqtt.questions.specs import QuestionSpec, SplitSpec
from scenegen.common.names import check_choice
from scenegen.common.records import check, check_range
from scenegen.description.presets import preset_spec
from scenegen.description.specs import SPLITS, InteriorSpec

MARK = '"scenes":"interiors"'  # in the JSON of these settings and of no others
ANGLES = (20.0, 120.0)  # degrees
ANGLE_BINS = (20, 40, 60, 90, 120)  # degrees, by which results are reported
PRESETS: dict[str, dict[str, Any]] = {
    "perspective": {"train": 100, "labeled": 100, "val": 40, "test": 60},
    "perspective-suite": {"train": 0, "labeled": 0, "val": 8, "test": 100},
}
SUITE = {kind: (kind, row.options[0]) for kind, row in ROOM_KINDS.items()}


@dataclass(frozen=True)
class PerspectiveSpec(QuestionSpec):
    """The settings of a split of furnished rooms; see `QuestionSpec`. Lengths are in metres.

    Attributes:
        angle: least and largest angle between the reference's line of sight and that of the
            options, about the vertical axis, degrees; questions draw theirs uniformly.
        objects: fewest and most objects of a room.
        object_split: which objects of each class are drawn from.
        spp: colour samples per pixel.
        denoise: whether images are denoised.
        scenes: what the questions are about.
    """

    KINDS: ClassVar[Mapping[str, QuestionKind]] = ROOM_KINDS
    SMALLEST: ClassVar[int] = 48

    height: int = 256
    width: int = 256
    angle: tuple[float, float] = ANGLES
    objects: tuple[int, int] = (12, 40)
    object_split: str = "all"
    spp: int = 8
    denoise: bool = False
    scenes: str = "interiors"

    def __post_init__(self) -> None:
        super().__post_init__()
        check(self.answers == 3, "answers", self.answers, "3 with questions about rooms")
        check_range("angle", self.angle, *ANGLES)
        check_choice("object split", self.object_split, SPLITS)
        check_choice("scenes", self.scenes, ("interiors",))
        self.interior()

    def interior(self) -> InteriorSpec:
        """Return the request for the rooms; that of settings without a seed has the seed 0.

        Kinds of questions that share a seed share no room. Raises SpecError for settings that it
        does not allow.
        """
        text = f"perspective {self.seed or 0} {self.distractors} {self.answers}"
        spec = preset_spec(
            "interiors",
            seed=int.from_bytes(hashlib.sha256(text.encode()).digest()[:8]) >> 1,
            height=self.height,
            width=self.width,
            objects=self.objects,
            object_split=self.object_split,
            spp=self.spp,
            denoise=self.denoise,
        )
        assert isinstance(spec, InteriorSpec)
        return spec


def split_spec(text: str | bytes) -> QuestionSpec:
    """Read the settings of any split. Raises SpecError on anything else."""
    mark = MARK if isinstance(text, str) else MARK.encode()
    kind = PerspectiveSpec if mark in text else SplitSpec  # type: ignore[operator]
    return kind.from_json(text)


def perspective_spec(preset: str, **settings: Any) -> PerspectiveSpec:
    """Return the spec of a preset, some settings replaced, as `specs.preset_spec`."""
    check_choice("preset", preset, PRESETS)
    chosen = {**PRESETS[preset], **settings}
    if "train" in settings and "labeled" not in settings:
        chosen["labeled"] = chosen["train"]
    return PerspectiveSpec(**chosen)
