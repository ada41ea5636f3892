"""Frozen descriptions of a data set and of a scene; JSON both ways.

A `DatasetSpec` is the request, a `SceneSpec` one answer to it: everything that the renderer needs
and nothing random. Lengths are in scene units (the room's edge), frames as in `camera.py`.
"""

import hashlib
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, get_args

from scenegen.camera import Camera, Vector3
from scenegen.records import check, check_range, from_json, normalise, to_json

ShapeName = Literal[
    "box",
    "sphere",
    "cone",
    "torus",
    "cylinder",
    "teapot",
    "capsule",
    "pyramid",
    "prism",
    "tetrahedron",
    "octahedron",
    "dodecahedron",
    "icosahedron",
]
SHAPE_NAMES: tuple[str, ...] = get_args(ShapeName)
IMAGE_DTYPES = ("uint8", "float16", "float32")
POSES = ("resting", "any")
MAX_OBJECTS = 100  # object ids are stored as int8
MAX_LIGHTS = 16
MAX_PIXELS = 4096 * 4096


@dataclass(frozen=True)
class Light:
    """A point light: its place in the world, and the RGB of L_j of the shading equation."""

    position: Vector3
    color: Vector3


@dataclass(frozen=True)
class PlacedObject:
    """A unit shape at its place: p_world = position + scale * rotate(rotation, p_object).

    `rotation` is a unit quaternion (w, x, y, z); `scale` is the radius of the bounding sphere
    about `position`, since unit shapes have bounding radius 1; `reflectance` is the RGB of rho.
    """

    shape: str
    position: Vector3
    rotation: tuple[float, float, float, float]
    scale: float
    reflectance: Vector3

    def __post_init__(self) -> None:
        check(self.shape in SHAPE_NAMES, "shape", repr(self.shape), f"one of {SHAPE_NAMES}")
        check(self.scale > 0, "scale", self.scale, "a positive number")
        norm = sum(q * q for q in self.rotation)
        check(abs(norm - 1) < 1e-6, "rotation", self.rotation, "a unit quaternion")


@dataclass(frozen=True)
class SceneSpec:
    """One scene in full.

    `attenuation` is (k_l, k_q) of the shading equation; `room_reflectance` is None where there is
    no room; `background` is the radiance of rays that meet nothing.
    """

    index: int
    cameras: tuple[Camera, ...]
    objects: tuple[PlacedObject, ...]
    lights: tuple[Light, ...]
    ambient: Vector3
    attenuation: tuple[float, float]
    room_reflectance: Vector3 | None
    background: Vector3 = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        check(self.index >= 0, "index", self.index, "0 or more")
        check(len(self.cameras) > 0, "cameras", "none", "at least one")

    def to_json(self) -> str:
        """Return the description as one line of JSON; floats keep every bit."""
        return to_json(self)

    @classmethod
    def from_json(cls, text: str | bytes) -> "SceneSpec":
        """Read what `to_json` wrote. Raises SpecError where the text is no scene description."""
        return from_json(cls, text, "scene description")


@dataclass(frozen=True)
class DatasetSpec:
    """The request that a file of rooms answers; item i depends on this and on i alone.

    Attributes:
        seed: dataset seed, 0 to 2**63 - 1.
        height, width: image size in pixels.
        objects: fewest and most objects of a scene.
        shapes: names to draw from, each with the same probability.
        object_radius: smallest and largest bounding radius of an object, scene units.
        pose: "resting" puts every object down in a position where it would stay; "any" turns it
            uniformly on SO(3) and lowers it until it touches the floor.
        lights: fewest and most point lights.
        shadows: whether lights are occluded (the paper's shading equation has no visibility term).
        spp: colour samples per pixel; 1 shades the ground-truth hit itself.
        image_dtype: "uint8" (linear radiance 0..1 as 0..255), "float16" or "float32" (radiance).
        min_visible_pixels: every object shows at least so many pixels in every view.
        allow_cropped: let the image's border cut objects (their centres stay in the image).
        fov_degrees: field of view of a square image; others have its diagonal.
        camera_radius: distance from camera to target, scene units.
        camera_target: the fixed point of the room that cameras look at, world.
        light_radius: distance from the target to each light, scene units.
        light_level: radiance of a white surface at the target that faces all lights, ambient apart.
        ambient: the RGB of L_a.
        attenuation: k_l and k_q of the shading equation.
        reflectance: the RGB of rho, the same for room and objects.
    """

    seed: int = 0
    height: int = 128
    width: int = 128
    objects: tuple[int, int] = (1, 3)
    shapes: tuple[str, ...] = SHAPE_NAMES
    object_radius: tuple[float, float] = (0.11, 0.22)
    pose: str = "resting"
    lights: tuple[int, int] = (1, 3)
    shadows: bool = False
    spp: int = 1
    image_dtype: str = "uint8"
    min_visible_pixels: int = 50
    allow_cropped: bool = False
    fov_degrees: float = 28.0
    camera_radius: float = 1.5
    camera_target: Vector3 = (0.3, 0.3, 0.3)
    light_radius: float = 2.5
    light_level: float = 0.95
    ambient: Vector3 = (0.1, 0.1, 0.1)
    attenuation: tuple[float, float] = (0.5, 0.5)
    reflectance: Vector3 = (0.8, 0.8, 0.8)

    def __post_init__(self) -> None:
        normalise(self)
        check(0 <= self.seed < 2**63, "seed", self.seed, "a whole number from 0 to 2**63 - 1")
        sides = (self.height, self.width)
        check(min(sides) >= 8, "size", f"{sides[0]}x{sides[1]}", "at least 8 pixels a side")
        check(
            self.height * self.width <= MAX_PIXELS,
            "size",
            f"{sides[0]}x{sides[1]}",
            f"at most {MAX_PIXELS:,} pixels",
        )
        check_range("objects", self.objects, 0, MAX_OBJECTS)
        check_range("lights", self.lights, 0, MAX_LIGHTS)
        check_range("object radius", self.object_radius, 0.005, 0.5)
        check(len(self.shapes) > 0, "shapes", "none", f"some of {', '.join(SHAPE_NAMES)}")
        for name in self.shapes:
            check(name in SHAPE_NAMES, "shapes", repr(name), f"some of {', '.join(SHAPE_NAMES)}")
        check(len(set(self.shapes)) == len(self.shapes), "shapes", self.shapes, "each name once")
        check(self.pose in POSES, "pose", self.pose, f"one of {', '.join(POSES)}")
        check(
            self.image_dtype in IMAGE_DTYPES,
            "image dtype",
            self.image_dtype,
            f"one of {', '.join(IMAGE_DTYPES)}",
        )
        check(1 <= self.spp <= 1024, "spp", self.spp, "from 1 to 1024")
        pixels = self.height * self.width
        check(
            0 <= self.min_visible_pixels <= pixels,
            "min visible pixels",
            self.min_visible_pixels,
            f"from 0 to the image's {pixels} pixels",
        )
        check(1.0 <= self.fov_degrees <= 120.0, "fov", self.fov_degrees, "from 1 to 120 degrees")
        check(
            all(0.0 < x < 1.0 for x in self.camera_target),
            "camera target",
            self.camera_target,
            "inside the unit room",
        )
        corner = math.dist(self.camera_target, (1.0, 1.0, 1.0))
        for name, radius, most in (
            ("camera radius", self.camera_radius, 10.0),
            ("light radius", self.light_radius, 100.0),
        ):
            expected = f"from {corner:.3f} (just around the room) to {most:g} scene units"
            check(corner <= radius <= most, name, radius, expected)
        check(0.0 <= self.light_level <= 100.0, "light level", self.light_level, "from 0 to 100")
        for name, color in (("ambient", self.ambient), ("reflectance", self.reflectance)):
            check(all(0.0 <= c <= 1.0 for c in color), name, color, "channels from 0 to 1")
        check(
            min(self.attenuation) >= 0.0 and sum(self.attenuation) > 0.0,
            "attenuation",
            self.attenuation,
            "k_l and k_q, neither negative, not both 0",
        )

    @property
    def object_slots(self) -> int:
        """Length of the object axis of every array; at least 1, as HDF5 wants it."""
        return max(1, self.objects[1])

    @property
    def light_slots(self) -> int:
        """Length of the light axis of every array; at least 1, as HDF5 wants it."""
        return max(1, self.lights[1])

    @property
    def fov_y_degrees(self) -> float:
        """Vertical field of view; the diagonal is that of a square image with `fov_degrees`."""
        return Camera.fov_y_from_square(self.fov_degrees, self.height, self.width)

    def to_json(self) -> str:
        """Return the request as one line of JSON with sorted keys."""
        return to_json(self, sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> "DatasetSpec":
        """Read what `to_json` wrote. Raises SpecError on anything else."""
        return from_json(cls, text, "dataset spec")


def fingerprint(spec: DatasetSpec, scene_lines: Iterable[str]) -> str:
    """SHA-256, as hex, of the request and of every scene: equal if and only if the truth is.

    It says nothing about storage (compression) or about the machine that rendered.
    """
    digest = hashlib.sha256(spec.to_json().encode())
    for line in scene_lines:
        digest.update(b"\n" + line.encode())
    return digest.hexdigest()
