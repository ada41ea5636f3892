"""The request for a data set, as JSON and back. `SceneSpec` describes one scene of it.

Lengths are in scene units (the room's edge), frames as in `camera.py`.
"""

import itertools
import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import Camera, Vector3
from scenegen.common.names import check_choice
from scenegen.common.records import check, check_range, from_json, normalise, to_json
from scenegen.description.scenes import FAMILY_NAMES, FURNITURE_NAMES
from scenegen.description.shapes import DRAWN_SHAPES, SHAPE_NAMES

IMAGE_DTYPES = ("uint8", "float16", "float32")
BUILT_IN = {"shapes": SHAPE_NAMES, "families": FAMILY_NAMES + FURNITURE_NAMES}
FOLDERS = ("shapenet-v1", "shapenet-v2", "folder")
SPLITS = ("all", "train", "val", "test")
TRUTHS = ("amodal", "coordinates", "flow", "albedo")
MAX_CLASSES = 4000  # their names are an attribute, of which HDF5 allows 64 kB
MAX_LIGHTS = 16
MAX_PIXELS = 4096 * 4096
MAX_VIEWS = 64
LEAST_SEEN = 4  # objects of a closed room that show `min_visible_pixels`, in every view
VISIBLE_SHARE = 0.003  # least share of the pixels of an image that show an object, by default
FROM_SIZE = -(2**62)  # stands for the number that follows from the size of the image
MOST_TURN = 80.0  # degrees between two views; at 90 all input views would be the same
LIMITS: dict[str, tuple[float, float]] = {  # of settings that are a number or a range of numbers
    "spp": (1, 1024),
    "objects": (0, 100),  # object ids are stored as int8
    "object_radius": (0.005, 0.5),
    "specular": (0.0, 10.0),
    "shininess": (1.0, 10_000.0),
    "lights": (0, MAX_LIGHTS),
    "light_level": (0.0, 100.0),
    "light_saturation": (0.0, 1.0),
    "hours": (0.0, 24.0),
    "sensor_noise": (0.0, 1.0),
}
# Cameras look at something, and the shell is cast as one more object.
INTERIOR_LIMITS = {**LIMITS, "objects": (1, 99)}
# Settings of the paper's room, which closed rooms do not have.
PAPER_ONLY = (
    "object_radius", "pose", "lights", "shadows", "allow_cropped", "camera_radius",
    "camera_target", "light_radius", "light_level", "ambient", "attenuation", "light_saturation",
    "reflectance", "room_reflectance", "random_reflectance", "specular", "shininess",
    "own_reflectance",
)  # fmt: skip
INTERIOR_ONLY = ("hours", "denoise", "sensor_noise", "materials", "environment")
FOV = (1.0, 120.0)  # degrees
LATER: dict[str, object] = {
    "truth": (),
    "own_reflectance": False,
    "fov_spread_degrees": 0.0,
    "interior": False,
    "hours": (7.0, 21.0),
    "denoise": False,
    "sensor_noise": 0.0,
    "materials": "",
    "environment": "",
}  # fields that came after 1.0, with their defaults
CHOICES = {
    "image_dtype": IMAGE_DTYPES,
    "shading": ("paper", "path"),
    "pose": ("resting", "any"),
    "source": (*BUILT_IN, *FOLDERS),
    "object_split": SPLITS,
}


@dataclass(frozen=True)
class DatasetSpec:
    """What a file of rooms should hold; item i depends on this and on i alone.

    Attributes:
        seed: dataset seed, 0 to 2**63 - 1.
        height, width: image size in pixels.
        objects: fewest and most objects of a scene.
        source: what objects are: "shapes" for basic shapes, "families" for the built-in object
            classes, else the kind of folder that their meshes come from; the
            classes of closed rooms that a folder lacks are built in.
        shapes: names to draw from, each with the same probability: basic shapes, or classes.
        object_split: which objects of a class are drawn from (see `meshes.listing.object_split`).
        listing: digest of the names of a folder's models; empty for what is built in.
        object_radius: smallest and largest bounding radius of an object, scene units.
        pose: "resting" puts every object down in a position where it would stay; "any" turns it
            uniformly on SO(3) and lowers it until it touches the floor.
        lights: fewest and most point lights.
        views: degrees about the vertical axis through the target, from the input view, which is
            the first, to each view of a scene; see `sampling.cameras`.
        shading: "paper" for the paper's equation, "path" for a path tracer on the same scene.
        shadows: whether lights are occluded (the paper's shading equation has no visibility term).
        spp: colour samples per pixel; 1 shades the ground-truth hit itself.
        image_dtype: "uint8" (linear radiance 0..1 as 0..255), "float16" or "float32" (radiance).
        min_visible_pixels: every object shows at least so many pixels in every view, in closed
            rooms LEAST_SEEN objects; by default VISIBLE_SHARE of the image's, at least 1.
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
        truth: further truth of each row, some of TRUTHS (`rooms.truth`).
        own_reflectance: multiply the reflectance of objects by the colours of their files; the
            truth then has "albedo", as no other column tells it.
        fov_spread_degrees: how much wider than `fov_degrees` a scene's field of view can be; each
            scene draws its own, uniformly.
        interior: closed rooms with furniture, in metres (`description.interiors`), instead of the
            paper's floor and two walls. The settings of PAPER_ONLY are then unused.
        hours: earliest and latest hour of the day; each scene draws its own, uniformly.
        denoise: whether pictures are denoised.
        sensor_noise: standard deviation of noise that is added to pictures, as a share of white.
        materials: digest of a folder of materials; empty for those that are drawn.
        environment: digest of a picture of the surroundings; empty for sun and sky.
    """

    seed: int = 0
    height: int = 128
    width: int = 128
    objects: tuple[int, int] = (1, 3)
    source: str = "shapes"
    shapes: tuple[str, ...] = DRAWN_SHAPES
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
    min_visible_pixels: int = FROM_SIZE
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
    truth: tuple[str, ...] = ()
    own_reflectance: bool = False
    fov_spread_degrees: float = 0.0
    interior: bool = False
    hours: tuple[float, float] = (7.0, 21.0)
    denoise: bool = False
    sensor_noise: float = 0.0
    materials: str = ""
    environment: str = ""

    def __post_init__(self) -> None:
        normalise(self)
        if self.min_visible_pixels == FROM_SIZE:
            least = max(1, round(VISIBLE_SHARE * self.height * self.width))
            object.__setattr__(self, "min_visible_pixels", least)
        check(0 <= self.seed < 2**63, "seed", self.seed, "a whole number from 0 to 2**63 - 1")
        _check_limits(self)
        _check_image(self)
        _check_objects(self)
        _check_places(self)
        _check_truth(self)
        _check_interior(self)

    @property
    def object_slots(self) -> int:
        """Length of the object axis of every array; at least 1, which HDF5 needs."""
        return max(1, self.objects[1])

    def seen_enough(self, visible: NDArray[Any], count: NDArray[Any]) -> NDArray[Any]:
        """Return whether images show enough of their objects, (B,).

        Args:
            visible: pixels of each object, (B, K).
            count: of objects of each image, (B,).
        """
        seen = (visible >= self.min_visible_pixels) & (np.arange(visible.shape[1]) < count[:, None])
        least = np.minimum(count, LEAST_SEEN) if self.interior else count
        return np.asarray(seen.sum(axis=1) >= least)

    @property
    def light_slots(self) -> int:
        """Length of the light axis of every array; at least 1, which HDF5 needs."""
        return max(1, self.lights[1])

    @property
    def fov_y_degrees(self) -> float:
        """Vertical field of view; the diagonal is that of a square image with `fov_degrees`.

        Raises SpecError where scenes have different ones.
        """
        widest = self.fov_degrees + self.fov_spread_degrees
        found = f"scenes of {self.fov_degrees:g} to {widest:g} degrees"
        check(widest == self.fov_degrees, "fov", found, "one field of view for all scenes")
        return Camera.fov_y_from_square(self.fov_degrees, self.height, self.width)

    def to_json(self) -> str:
        """Return the request as one line of JSON with sorted keys.

        Fields that came after version 1.0 of the format are left out where they have their default.
        """
        later = {name: value for name, value in LATER.items() if getattr(self, name) == value}
        return to_json({k: v for k, v in vars(self).items() if k not in later}, sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> "DatasetSpec":
        """Read what `to_json` wrote. Raises SpecError on anything else."""
        return from_json(cls, text, "dataset spec")


def _check_limits(spec: DatasetSpec) -> None:
    """Check each setting by itself, where two numbers or a few words limit it."""
    for name, (low, high) in (INTERIOR_LIMITS if spec.interior else LIMITS).items():
        value, shown = getattr(spec, name), name.removesuffix("_degrees").replace("_", " ")
        if isinstance(value, tuple):
            check_range(shown, value, low, high)
        else:
            check(low <= value <= high, shown, value, f"from {low:g} to {high:g}")
    for name, choices in CHOICES.items():
        check_choice(name.replace("_", " "), getattr(spec, name), choices)
    for name in ("ambient", "reflectance", "room_reflectance"):
        color = getattr(spec, name)
        ok = len(color) == 3 and all(0.0 <= c <= 1.0 for c in color)
        check(ok, name.replace("_", " "), color, "channels from 0 to 1")


def _check_image(spec: DatasetSpec) -> None:
    check_range("fov", (spec.fov_degrees, spec.fov_degrees + spec.fov_spread_degrees), *FOV)
    sides, pixels = f"{spec.height}x{spec.width}", spec.height * spec.width
    check(min(spec.height, spec.width) >= 8, "size", sides, "at least 8 pixels a side")
    check(pixels <= MAX_PIXELS, "size", sides, f"at most {MAX_PIXELS:,} pixels")
    least = spec.min_visible_pixels
    expected = f"from 0 to the image's {pixels} pixels"
    check(0 <= least <= pixels, "min visible pixels", least, expected)
    allowed = "one of the two: a path tracer always casts shadows"
    both = spec.shadows and spec.shading == "path"
    check(not both, "shadows", "with shading 'path'", allowed)


def _check_objects(spec: DatasetSpec) -> None:
    what = "shapes" if spec.source == "shapes" else "classes"
    names = BUILT_IN.get(spec.source)
    expected = f"some of {', '.join(names)}" if names else "names of classes"
    check(len(spec.shapes) > 0, what, "none", expected)
    check(len(spec.shapes) <= MAX_CLASSES, what, len(spec.shapes), f"at most {MAX_CLASSES:,}")
    for name in spec.shapes:
        if names:
            check_choice(what, name, names, expected=expected)
        check(name != "" and "/" not in name, what, repr(name), expected)
    check(len(set(spec.shapes)) == len(spec.shapes), what, spec.shapes, "each name once")
    if spec.source == "shapes":
        check(spec.object_split == "all", "object split", spec.object_split, "'all' for shapes")


def _check_places(spec: DatasetSpec) -> None:
    inside = all(0.0 < x < 1.0 for x in spec.camera_target)
    check(inside, "camera target", spec.camera_target, "inside the unit room")
    corner = math.dist(spec.camera_target, (1.0, 1.0, 1.0))
    for name, radius, most in (
        ("camera radius", spec.camera_radius, 10.0),
        ("light radius", spec.light_radius, 100.0),
    ):
        expected = f"from {corner:.3f} (just around the room) to {most:g} scene units"
        check(corner <= radius <= most, name, radius, expected)
    views = spec.views
    rising = all(a < b for a, b in itertools.pairwise(views))
    check(
        0 < len(views) <= MAX_VIEWS and views[0] == 0 and rising and views[-1] <= MOST_TURN,
        "views",
        ", ".join(f"{v:g}" for v in views) or "none",
        f"rising degrees from 0, the input view, to at most {MOST_TURN:g}, such as 0,5,35,55,80",
    )
    both = len(spec.attenuation) == 2 and all(0.0 <= k <= 100.0 for k in spec.attenuation)
    check(
        both and sum(spec.attenuation) >= 1e-6,
        "attenuation",
        spec.attenuation,
        "k_l and k_q from 0 to 100, not both 0",
    )


def _check_truth(spec: DatasetSpec) -> None:
    if spec.own_reflectance:
        where, meshes = "own reflectance", "meshes from a folder"
        check(spec.source in FOLDERS, where, spec.source, meshes)
        check(spec.shading == "paper", where, f"shading {spec.shading}", "shading 'paper'")
        both = "one of own and random reflectance"
        check(not spec.random_reflectance, where, "with random reflectance", both)
        object.__setattr__(spec, "truth", (*spec.truth, "albedo"))
    wrong = [name for name in spec.truth if name not in TRUTHS]
    check(not wrong, "truth", ", ".join(wrong), f"some of {', '.join(TRUTHS)}")
    object.__setattr__(spec, "truth", tuple(name for name in TRUTHS if name in spec.truth))
    expected = "two views or more, such as --views 0,35"
    check("flow" not in spec.truth or len(spec.views) > 1, "flow", "one view", expected)


def _check_interior(spec: DatasetSpec) -> None:
    """Refuse settings of closed rooms elsewhere, and the paper's settings in closed rooms."""
    defaults = {field.name: field.default for field in fields(DatasetSpec)}
    foreign = PAPER_ONLY if spec.interior else INTERIOR_ONLY
    for name in foreign:
        where = "preset interiors" if spec.interior else "a preset other than interiors"
        unused = getattr(spec, name) == defaults[name]
        check(unused, name.replace("_", " "), f"{getattr(spec, name)} with {where}", "none")
    if spec.interior:
        check(spec.shading == "path", "shading", f"{spec.shading} with interiors", "path")
        classes = "none: interiors are furnished with classes (--classes)"
        check(spec.source != "shapes", "shapes", "given with interiors", classes)
