"""What a split is asked to be, frozen and checked; JSON both ways. Lengths are in cube edges."""

import math
from dataclasses import dataclass, replace
from typing import Any

from iqtt.shapes.polycube import MAX_CUBES
from iqtt.shapes.sampling import Kind
from scenegen.camera import Camera, Vector3
from scenegen.common.records import check, from_json, normalise, to_json
from scenegen.description.specs import IMAGE_DTYPES, MAX_LIGHTS, DatasetSpec

SPLITS = ("train", "val", "test")
DISTRACTORS = ("other", "near", "mirror", "mixed")
KINDS = ("chain", "tree")
PRESETS: dict[str, dict[str, int]] = {
    # training questions in all, labelled ones among them, validation, test
    "small": {"train": 1_000, "labeled": 100, "val": 200, "test": 200},
    "v2": {"train": 100_000, "labeled": 10_000, "val": 10_000, "test": 10_000},
    "paper": {"train": 100_000, "labeled": 1_000, "val": 100_000, "test": 100_000},
}


@dataclass(frozen=True)
class SplitSpec:
    """The request that the files of a split answer.

    Attributes:
        seed: of every random choice; None where a file keeps it to itself (see `public`).
        train, labeled, val, test: numbers of questions; the labelled are part of train.
        cubes: fewest and most cubes of a shape; each number is as likely.
        shapes: "chain" (self-avoiding chains) or "tree" (they may branch).
        distractors: "other", "near", "mirror", or "mixed" (each question one of the three).
        height, width: of an image, pixels.
        image_dtype: "uint8", "float16" or "float32" (radiance 0..1).
        min_angle_degrees: least rotation between the reference's view and any answer's.
        min_cube_pixels: every cube shows at least so many pixels in every image.
        max_radius: of a shape's bounding sphere, cube edges; the camera frames just that sphere.
        lights: fewest and most point lights; the first one is within 60 degrees of the camera.
        background, ambient, reflectance: RGB. With the light_level, the radiance that all lights
            together give a white surface that faces them at the origin, the defaults keep every
            surface darker than the background.
        fov_degrees: across the shorter side of the image.
        with_depth: whether planar depth is stored too.
    """

    seed: int | None = 0
    train: int = 1_000
    labeled: int = 100
    val: int = 200
    test: int = 200
    cubes: tuple[int, int] = (5, 11)
    shapes: str = "chain"
    distractors: str = "mixed"
    height: int = 128
    width: int = 128
    image_dtype: str = "uint8"
    min_angle_degrees: float = 30.0
    min_cube_pixels: int = 12
    max_radius: float = 3.5
    lights: tuple[int, int] = (2, 2)
    background: Vector3 = (1.0, 1.0, 1.0)
    ambient: Vector3 = (0.25, 0.25, 0.25)
    reflectance: Vector3 = (0.8, 0.8, 0.8)
    light_level: float = 0.75
    fov_degrees: float = 28.0
    with_depth: bool = False

    def __post_init__(self) -> None:
        normalise(self)
        if self.seed is not None:
            object.__setattr__(self, "seed", int(self.seed))
        check(self.seed is None or 0 <= self.seed < 2**63, "seed", self.seed, "0 to 2**63 - 1")
        for name in ("train", "val", "test"):
            count = getattr(self, name)
            check(0 <= count <= 10**8, name, count, "from 0 to 100,000,000 questions")
        check(
            0 <= self.labeled <= self.train,
            "labeled",
            self.labeled,
            f"from 0 to the {self.train} training questions",
        )
        low, high = self.cubes
        check(
            3 <= low <= high <= MAX_CUBES,
            "cubes",
            f"{low}-{high}",
            f"a number or a rising range within 3-{MAX_CUBES}",
        )
        check(self.shapes in KINDS, "shapes", self.shapes, f"one of {', '.join(KINDS)}")
        check(
            self.distractors in DISTRACTORS,
            "distractors",
            self.distractors,
            f"one of {', '.join(DISTRACTORS)}",
        )
        sides = f"{self.height}x{self.width}"
        check(
            min(self.height, self.width) >= 16 and max(self.height, self.width) <= 4096,
            "size",
            sides,
            "from 16 to 4096 pixels a side",
        )
        check(
            self.image_dtype in IMAGE_DTYPES,
            "image dtype",
            self.image_dtype,
            f"one of {', '.join(IMAGE_DTYPES)}",
        )
        check(
            0 <= self.min_angle_degrees <= 90,
            "min angle",
            self.min_angle_degrees,
            "from 0 to 90 degrees",
        )
        check(1.5 <= self.max_radius <= 10, "max radius", self.max_radius, "from 1.5 to 10 edges")
        check(5 <= self.fov_degrees <= 90, "fov", self.fov_degrees, "from 5 to 90 degrees")
        most = max(1, int(0.2 * self.pixels_per_edge**2))
        check(
            0 <= self.min_cube_pixels <= most,
            "min cube pixels",
            self.min_cube_pixels,
            f"from 0 to {most}, a fifth of a cube's face at {sides}",
        )
        check(
            1 <= self.lights[0] <= self.lights[1] <= MAX_LIGHTS,
            "lights",
            f"{self.lights[0]}-{self.lights[1]}",
            f"a number or a rising range within 1-{MAX_LIGHTS}",
        )
        check(0 <= self.light_level <= 100, "light level", self.light_level, "from 0 to 100")
        for name in ("background", "ambient", "reflectance"):
            color = getattr(self, name)
            check(all(0 <= c <= 1 for c in color), name, color, "channels from 0 to 1")

    @property
    def camera_distance(self) -> float:
        """Where the bounding sphere just fits the image, with 2% to spare; cube edges."""
        return 1.02 * self.max_radius / math.sin(math.radians(self.fov_degrees) / 2)

    @property
    def light_distance(self) -> float:
        """Of the lights from the origin: far enough that near parts of a shape are hardly brighter;
        cube edges.
        """
        return 2 * self.camera_distance

    @property
    def pixels_per_edge(self) -> float:
        """Pixels along an edge, face on, at the camera's distance from the origin."""
        half = math.tan(math.radians(self.fov_degrees) / 2) * self.camera_distance
        return min(self.height, self.width) / 2 / half

    @property
    def camera(self) -> Camera:
        """The one camera of all images: on +z, looking at the origin."""
        if self.height <= self.width:
            fov_y = self.fov_degrees
        else:
            half = math.tan(math.radians(self.fov_degrees) / 2) * self.height / self.width
            fov_y = math.degrees(2 * math.atan(half))
        return Camera((0.0, 0.0, self.camera_distance), (0.0, 0.0, 0.0), fov_y)

    @property
    def kind(self) -> Kind:
        """`shapes`, as the type that the generators take."""
        return "chain" if self.shapes == "chain" else "tree"

    def render_spec(self, shrink: int = 1) -> DatasetSpec:
        """Return the renderer's settings, the image `shrink` times smaller."""
        return DatasetSpec(
            height=max(8, self.height // shrink),
            width=max(8, self.width // shrink),
            objects=self.cubes,
            shapes=("box",),
            lights=self.lights,
            image_dtype=self.image_dtype,
            min_visible_pixels=0,
        )

    def public(self) -> "SplitSpec":
        """Return the spec without its seed, from which the test answers could be made again."""
        return replace(self, seed=None)

    def to_json(self) -> str:
        """Return the request as one line of JSON with sorted keys."""
        return to_json(self, sort_keys=True)

    @classmethod
    def from_json(cls, text: str | bytes) -> "SplitSpec":
        """Read what `to_json` wrote. Raises SpecError on anything else."""
        return from_json(cls, text, "split spec")


def preset_spec(preset: str, **settings: Any) -> SplitSpec:
    """Return a preset's numbers of questions with other settings on top.

    Two settings that are not given follow others: `labeled` keeps the preset's share of `train`,
    and `min_cube_pixels` the default's share of a cube's face.

    Raises SpecError.
    """
    check(preset in PRESETS, "preset", preset, f"one of {', '.join(PRESETS)}")
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
