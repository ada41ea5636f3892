"""Description of one scene, as JSON and back: everything that the renderer needs.

Lengths are in scene units (the room's edge; metres in closed rooms), frames as in `camera.py`.
"""

from dataclasses import dataclass

from scenegen.camera import Camera
from scenegen.common.records import Vector3, check, from_json, to_json
from scenegen.description.interiors import Interior
from scenegen.description.names import SHAPE_NAMES


@dataclass(frozen=True)
class Light:
    """A point light: its place in the world, and the RGB of L_j of the shading equation."""

    position: Vector3
    color: Vector3


@dataclass(frozen=True)
class PlacedObject:
    """A unit shape in its place: p_world = position + scale * rotate(rotation, p_object).

    Attributes:
        shape: the name of a basic shape, or class and model of an object, as in "mug/0412".
        position: world, of the unit shape's origin.
        rotation: unit quaternion (w, x, y, z).
        scale: radius of the bounding sphere about `position`; unit shapes have radius 1.
        reflectance: the RGB of rho, for diffuse reflection.
        specular: Phong's k_s, the same for all colours.
        shininess: Phong's exponent.
        mesh: digest of the model's file, 16 hex digits; empty for built-in objects.
    """

    shape: str
    position: Vector3
    rotation: tuple[float, float, float, float]
    scale: float
    reflectance: Vector3
    specular: float = 0.0
    shininess: float = 1.0
    mesh: str = ""

    def __post_init__(self) -> None:
        is_shape = self.shape in SHAPE_NAMES or "/" in self.shape[1:-1]
        check(is_shape, "shape", repr(self.shape), f"class/model, or one of {SHAPE_NAMES}")
        check(self.scale > 0, "scale", self.scale, "a positive number")
        check(self.specular >= 0, "specular", self.specular, "0 or more")
        check(self.shininess > 0, "shininess", self.shininess, "a positive number")
        norm = sum(q * q for q in self.rotation)
        check(abs(norm - 1) < 1e-6, "rotation", self.rotation, "a unit quaternion")

    @property
    def name(self) -> str:
        """The basic shape's name, or the object's class."""
        return self.shape.partition("/")[0]


@dataclass(frozen=True)
class SceneSpec:
    """One scene in full.

    Attributes:
        index: number of the scene in its data set.
        cameras: one for each view.
        ambient: the RGB of L_a.
        attenuation: (k_l, k_q) of the shading equation.
        room_reflectance: the RGB of rho of ground and walls; None without a room.
        background: radiance of rays that hit no surface.
        interior: the closed room; None for a box room (ground and two walls).
    """

    index: int
    cameras: tuple[Camera, ...]
    objects: tuple[PlacedObject, ...]
    lights: tuple[Light, ...]
    ambient: Vector3
    attenuation: tuple[float, float]
    room_reflectance: Vector3 | None
    background: Vector3 = (0.0, 0.0, 0.0)
    interior: Interior | None = None

    def __post_init__(self) -> None:
        check(0 <= self.index < 2**63, "index", self.index, "0 or more, below 2**63")
        check(len(self.cameras) > 0, "cameras", "none", "at least one")
        if self.interior:
            count, expected = len(self.interior.stands_on), f"one for each of {len(self.objects)}"
            check(count == len(self.objects), "stands on", f"{count} objects", expected)

    def to_json(self) -> str:
        """Return the description as one line of JSON; floats keep every bit."""
        parts = vars(self)
        return to_json(parts if self.interior else {k: parts[k] for k in parts if k != "interior"})

    @classmethod
    def from_json(cls, text: str | bytes) -> "SceneSpec":
        """Read what `to_json` wrote. Raises SpecError for any other text."""
        return from_json(cls, text, "scene description")
