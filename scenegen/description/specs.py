"""Frozen description of a data set, JSON both ways: the request; `scenes.SceneSpec` answers it.

Lengths are in scene units (the room's edge), frames as in `camera.py`.
"""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass

from scenegen.camera import Camera, Vector3
from scenegen.common.records import from_json, normalise, to_json
from scenegen.description.checks import check_dataset_spec
from scenegen.description.scenes import SHAPE_NAMES


@dataclass(frozen=True)
class DatasetSpec:
    """The request that a file of rooms answers; item i depends on this and on i alone.

    Attributes:
        seed: dataset seed, 0 to 2**63 - 1.
        height, width: image size in pixels.
        objects: fewest and most objects of a scene.
        source: what objects are: "shapes" for basic shapes, "families" for the built-in object
            classes, else the kind of folder that their meshes come from.
        shapes: names to draw from, each with the same probability: basic shapes, or classes.
        object_split: which objects of a class are drawn from (see `meshes.folders.object_split`).
        listing: digest of the names of a folder's models; empty for what is built in.
        object_radius: smallest and largest bounding radius of an object, scene units.
        pose: "resting" puts every object down in a position where it would stay; "any" turns it
            uniformly on SO(3) and lowers it until it touches the floor.
        lights: fewest and most point lights.
        views: degrees about the vertical axis through the target, from the input view, which is
            the first, to each view of a scene; see `sampling.view_cameras`.
        shading: "paper" for the paper's equation, "path" for a path tracer on the same scene.
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
        light_saturation: each light's RGB is drawn from 1 - this to 1, then its largest made 1.
        reflectance, room_reflectance: the RGB of rho, of objects and of the room.
        random_reflectance: draw every object's instead, from 0.15 to 0.95 each.
        specular, shininess: ranges of Phong's k_s and exponent of objects; the room is matte.
    """

    seed: int = 0
    height: int = 128
    width: int = 128
    objects: tuple[int, int] = (1, 3)
    source: str = "shapes"
    shapes: tuple[str, ...] = SHAPE_NAMES
    object_split: str = "all"
    listing: str = ""
    object_radius: tuple[float, float] = (0.11, 0.22)
    pose: str = "resting"
    lights: tuple[int, int] = (1, 3)
    views: tuple[float, ...] = (0.0,)
    shading: str = "paper"
    shadows: bool = False
    spp: int = 1
    image_dtype: str = "uint8"
    min_visible_pixels: int = 49
    allow_cropped: bool = False
    fov_degrees: float = 28.0
    camera_radius: float = 1.5
    camera_target: Vector3 = (0.3, 0.3, 0.3)
    light_radius: float = 2.5
    light_level: float = 0.95
    ambient: Vector3 = (0.1, 0.1, 0.1)
    attenuation: tuple[float, float] = (0.5, 0.5)
    light_saturation: float = 0.7
    reflectance: Vector3 = (0.8, 0.8, 0.8)
    room_reflectance: Vector3 = (0.8, 0.8, 0.8)
    random_reflectance: bool = False
    specular: tuple[float, float] = (0.0, 0.0)
    shininess: tuple[float, float] = (1.0, 1.0)

    def __post_init__(self) -> None:
        normalise(self)
        check_dataset_spec(self)

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
