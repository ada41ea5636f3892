"""The settings of a split: a frozen, checked dataclass, stored as JSON; lengths in cube edges."""

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Self, get_args

from iqtt.questions.kinds import QUESTION_KINDS, QuestionKind
from iqtt.shapes.chains_and_trees import Kind
from iqtt.shapes.polycube import MAX_CUBES
from scenegen.camera import Camera, half_angle
from scenegen.common.names import check_choice
from scenegen.common.records import Vector3, check, check_range, from_json, normalise, to_json
from scenegen.description.specs import IMAGE_DTYPES, MAX_LIGHTS, DatasetSpec

SPLITS = ("train", "val", "test")
LETTERS = "ABC"  # of answers, wherever people look; files count them from 0
SMALLEST_SECRET, LARGEST_SECRET = 16, 1_000_000  # bytes of a file whose content is a seed
MAX_QUESTIONS = 10**8  # of each of train, val and test
PRESETS: dict[str, dict[str, Any]] = {
    # training questions in all, labelled ones among them, validation, test
    "small": {"train": 1_000, "labeled": 100, "val": 200, "test": 200},
    "v2": {"train": 100_000, "labeled": 10_000, "val": 10_000, "test": 10_000}
    | {"image_dtype": "float32", "min_sight_angle_degrees": 0.0},
    "paper": {"train": 100_000, "labeled": 1_000, "val": 100_000, "test": 100_000}
    | {"min_sight_angle_degrees": 0.0},
    "suite": {"train": 5_000, "labeled": 1_000, "val": 500, "test": 2_000},
}
SUITE = {  # the splits of the suite: the kind and the number of answers of each
    "matched": ("matched", 3),
    "mirror-pair": ("mirror-pair", 3),
    "mirror-pair-2": ("mirror-pair", 2),
    "other": ("other", 3),
    "near": ("near", 3),
    "mirror": ("mirror", 3),
}


@dataclass(frozen=True)
class QuestionSpec:
    """What the settings of all splits share. With a seed, they determine every bit of its files.

    Attributes:
        seed: random seed, 0 to 2**256 - 1; None in files that must not reveal it (see `public`).
        train, val, test: numbers of questions; at least one question in all.
        labeled: number of labelled training questions.
        distractors: distractor type, one of `KINDS`, or "mixed", where each question samples one of
            those that have so many options.
        answers: number of options, 3 or 2; one option is correct.
        height, width: size of an image, pixels.
        image_dtype: "uint8", "float16" or "float32".
        with_depth: whether the files also hold planar depth.
    """

    KINDS: ClassVar[Mapping[str, QuestionKind]]
    SMALLEST: ClassVar[int] = 16  # side of an image, pixels

    seed: int | None = 0
    train: int = 1_000
    labeled: int = 100
    val: int = 200
    test: int = 200
    distractors: str = "mixed"
    answers: int = 3
    height: int = 128
    width: int = 128
    image_dtype: str = "uint8"
    with_depth: bool = False

    def __post_init__(self) -> None:
        normalise(self)
        if self.seed is not None:
            object.__setattr__(self, "seed", int(self.seed))
        check(self.seed is None or 0 <= self.seed < 2**256, "seed", self.seed, "0 to 2**256 - 1")
        for name in ("train", "val", "test"):
            _check_within(name, getattr(self, name), 0, MAX_QUESTIONS, " questions")
        _check_within("labeled", self.labeled, 0, self.train, " training questions")
        check_choice("distractors", self.distractors, (*self.KINDS, "mixed"))
        check_choice("image dtype", self.image_dtype, IMAGE_DTYPES)
        _check_within("answers", self.answers, 2, 3)
        if self.distractors != "mixed":
            options = self.KINDS[self.distractors].options
            expected = f"{options[0]} with the distractors {self.distractors}"
            check(self.answers in options, "answers", self.answers, expected)
        sides = f"{self.height}x{self.width}"
        small, large = min(self.height, self.width), max(self.height, self.width)
        least = self.SMALLEST
        check(
            small >= least and large <= 4096, "size", sides, f"from {least} to 4096 pixels a side"
        )

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of questions there are, of KINDS."""
        if self.distractors != "mixed":
            return (self.distractors,)
        kinds = self.KINDS.items()
        return tuple(name for name, it in kinds if it.mixed and self.answers in it.options)

    def public(self) -> Self:
        """Return the spec without its seed, which would reveal the answer key."""
        return replace(self, seed=None)

    def to_json(self) -> str:
        """Return the settings as one line of JSON with sorted keys."""
        return to_json(self, sort_keys=True)

    @classmethod
    def from_json(cls, text: str | bytes) -> Self:
        """Read what `to_json` wrote. Raises SpecError on anything else."""
        return from_json(cls, text, "split spec")


@dataclass(frozen=True)
class SplitSpec(QuestionSpec):
    """The settings of a split of polycubes; see `QuestionSpec`.

    Attributes:
        cubes: fewest and most cubes of a shape; every number in between is equally likely.
        shapes: "chain" for self-avoiding chains of cubes, "tree" for shapes that may branch.
        min_angle_degrees: minimum rotation between the views of the reference and of each option,
            and between the views of two options with the same shape.
        min_sight_angle_degrees: minimum angle between the viewing directions of these views, as
            axes in the frame of the shape (mirrored for a mirror image). Closer views have similar
            silhouettes.
        min_cube_pixels: minimum number of visible pixels of each cube in each image.
        max_radius: largest bounding sphere of a shape, cube edges.
        lights: fewest and most point lights.
        background, ambient, reflectance: RGB, 0..1.
        light_level: radiance of a white surface at the origin that faces all lights. With the
            defaults, every surface is darker than the background.
        fov_degrees: field of view across the shorter side of the image.
    """

    KINDS: ClassVar[Mapping[str, QuestionKind]] = QUESTION_KINDS

    cubes: tuple[int, int] = (8, 11)
    shapes: Kind = "chain"
    min_angle_degrees: float = 30.0
    min_sight_angle_degrees: float = 40.0
    min_cube_pixels: int = 30
    max_radius: float = 3.5
    lights: tuple[int, int] = (2, 2)
    background: Vector3 = (1.0, 1.0, 1.0)
    ambient: Vector3 = (0.2, 0.2, 0.2)
    reflectance: Vector3 = (0.8, 0.8, 0.8)
    light_level: float = 0.85
    fov_degrees: float = 28.0

    def __post_init__(self) -> None:
        super().__post_init__()
        sides = f"{self.height}x{self.width}"
        check_range("cubes", self.cubes, 3, MAX_CUBES)
        check_range("lights", self.lights, 1, MAX_LIGHTS)
        check_choice("shapes", self.shapes, get_args(Kind))
        _check_within("min angle", self.min_angle_degrees, 0, 90, " degrees")
        _check_within("min sight angle", self.min_sight_angle_degrees, 0, 60, " degrees")
        _check_within("max radius", self.max_radius, 1.5, 10, " cube edges")
        _check_within("fov", self.fov_degrees, 5, 90, " degrees")
        _check_within("light level", self.light_level, 0, 100)
        most = max(1, int(0.2 * self.pixels_per_edge**2))
        face = f" pixels, a fifth of a cube's face at {sides}"
        _check_within("min cube pixels", self.min_cube_pixels, 0, most, face)
        for name in ("background", "ambient", "reflectance"):
            color = getattr(self, name)
            check(all(0 <= c <= 1 for c in color), name, color, "channels from 0 to 1")

    @property
    def camera_distance(self) -> float:
        """The largest distance that the camera of a question has, cube edges; before format 2.0,
        that of all of them.
        """
        return self.framing_distance(self.max_radius)

    def framing_distance(self, radius: float) -> float:
        """Return the distance from camera to origin at which a sphere about the origin fits the
        image, with 2% and at least the pixels of the border to spare; cube edges.
        """
        side = min(self.height, self.width)
        spare = max(1.02, side / (side - 2))
        return spare * radius / half_angle(self.fov_degrees)[1]

    @property
    def pixels_per_edge(self) -> float:
        """Least length in pixels of a cube edge at the origin that is parallel to the image."""
        cosine, sine = half_angle(self.fov_degrees)
        half = sine / cosine * self.camera_distance
        return min(self.height, self.width) / 2 / half

    @property
    def fov_y_degrees(self) -> float:
        """Field of view across the image's height, degrees."""
        if self.height <= self.width:
            return self.fov_degrees
        cosine, sine = half_angle(self.fov_degrees)
        return round(math.degrees(2 * math.atan(sine / cosine * self.height / self.width)), 9)

    def camera(self, distance: float) -> Camera:
        """Return the camera of a question's images; it lies on +z and looks at the origin."""
        return Camera((0.0, 0.0, float(distance)), (0.0, 0.0, 0.0), self.fov_y_degrees)

    def render_spec(self) -> DatasetSpec:
        """Return the renderer's settings."""
        return DatasetSpec(
            height=self.height,
            width=self.width,
            objects=self.cubes,
            shapes=("box",),
            lights=self.lights,
            image_dtype=self.image_dtype,
            min_visible_pixels=0,
        )


def secret_seed(path: str | Path) -> int:
    """Return the seed that the content of a file makes, blanks at its ends aside.

    Raises OSError, and SpecError for a file with little or far too much in it.
    """
    with Path(path).open("rb") as file:
        content = file.read(LARGEST_SECRET + 1)
    secret = content.strip()
    _check_within(str(path), len(content), 0, LARGEST_SECRET, " bytes")
    _check_within(str(path), len(secret), SMALLEST_SECRET, LARGEST_SECRET, " bytes")
    return int.from_bytes(hashlib.sha256(secret).digest())


def preset_spec(preset: str, **settings: Any) -> SplitSpec:
    """Return the spec of a preset, with some settings replaced.

    Two settings that are not given follow from others: `labeled` is the preset's share of `train`,
    and `min_cube_pixels` the default's share of a cube's face.

    Raises SpecError for an unknown preset or a setting out of range.
    """
    check_choice("preset", preset, PRESETS)
    numbers = dict(PRESETS[preset])
    if "train" in settings:
        numbers["labeled"] = numbers["labeled"] * settings["train"] // numbers["train"]
    chosen = {**numbers, **settings}
    if "min_cube_pixels" not in chosen:
        side = min(chosen.get("height", 128), chosen.get("width", 128))
        radius = max(1.0, chosen.get("max_radius", SplitSpec.max_radius))  # 0 is refused below
        edge = side / 128 * SplitSpec.max_radius / radius
        chosen["min_cube_pixels"] = max(1, round(SplitSpec.min_cube_pixels * edge**2))
    return SplitSpec(**chosen)


def _check_within(name: str, value: float, low: float, high: float, unit: str = "") -> None:
    check(low <= value <= high, name, value, f"from {low:,} to {high:,}{unit}")
