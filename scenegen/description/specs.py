"""The request for a data set, as JSON and back. `SceneSpec` describes one scene of it.

`DatasetSpec` asks for the paper's rooms, and `InteriorSpec` for closed rooms with furniture. Each
setting stands once: it is a field, whose metadata has its limits and its text for `--help`. Lengths
are in scene units (side length of the room; metres in closed rooms), frames as in `camera.py`.
"""

import itertools
import json
import math
from contextlib import suppress
from dataclasses import Field, dataclass, field, fields
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

from scenegen.common.names import check_choice
from scenegen.common.records import (
    LONGEST_JSON,
    Vector3,
    check,
    check_range,
    from_json,
    normalise,
    to_json,
)
from scenegen.description.names import DRAWN_SHAPES, FAMILY_NAMES, FURNITURE_NAMES, SHAPE_NAMES

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from scenegen.camera import Lens

IMAGE_DTYPES = ("uint8", "float16", "float32")
BUILT_IN = {"shapes": SHAPE_NAMES, "families": FAMILY_NAMES + FURNITURE_NAMES}
FOLDERS = ("shapenet-v1", "shapenet-v2", "folder")
SPLITS = ("all", "train", "val", "test")
TRUTHS = ("amodal", "coordinates", "flow", "albedo", "layers")
MAX_CLASSES = 4000  # their names are an attribute, of which HDF5 allows 64 kB
MAX_LIGHTS = 16
MAX_PIXELS = 4096 * 4096
MAX_VIEWS = 64
LEAST_SEEN = 4  # objects of a closed room that show `min_visible_pixels`, in every view
VISIBLE_SHARE = 0.003  # least share of the pixels of an image that show an object, by default
FROM_SIZE = -(2**62)  # stands for the number that follows from the size of the image
MOST_TURN = 80.0  # degrees between two views; at 90 all input views would be the same
FOV = (1.0, 120.0)  # degrees
FARTHEST = 2.0  # images from the middle to the principal point, along a side


def setting(
    default: Any,
    text: str = "",
    *,
    limits: tuple[float, float] | None = None,
    choices: tuple[str, ...] | None = None,
    later: bool = False,
    option: str = "",
    shown: str = "",
) -> Any:
    """Return a field of a request.

    Args:
        text: what the help of `scenegen render` says; empty for what no option of its own sets.
        limits: least and largest number; of a range, of both its ends.
        choices: all values.
        later: whether the setting came after version 1.0 of the format. Requests that leave it at
            its default then have the JSON, and so the fingerprint, that they had without it.
        option: name of the option, where it is not the setting's; `--on/--off` for yes and no.
        shown: the default as the help shows it, where it is not the field's.
    """
    metadata = {"text": text, "limits": limits, "choices": choices, "later": later}
    return field(default=default, metadata={**metadata, "option": option, "shown": shown})


@dataclass(frozen=True)
class RoomSpec:
    """What `DatasetSpec` and `InteriorSpec` share. Item i depends on the request and on i alone.

    Attributes:
        seed: dataset seed, 0 to 2**63 - 1.
        height, width: image size in pixels.
        objects: fewest and most objects of a scene.
        source: "shapes" for basic shapes, "families" for the built-in object categories, else the
            type of the folder of meshes; closed rooms take categories that the folder lacks from
            the built-in ones.
        shapes: names to sample from with equal probability: basic shapes, or object categories.
        object_split: split of object instances to sample from (see `meshes.listing.object_split`).
        listing: hash of the names of the meshes of a folder; empty for built-in objects.
        views: degrees about the vertical axis through the target, from the input view, which is
            the first, to each view of a scene; see `sampling.cameras`.
        spp: colour samples per pixel; 1 shades the ground-truth hit itself.
        image_dtype: "uint8" (linear radiance 0..1 as 0..255), "float16" or "float32" (radiance).
        min_visible_pixels: minimum number of visible pixels of every object in every view (in
            closed rooms, of LEAST_SEEN objects); by default VISIBLE_SHARE of the image.
        fov_degrees: field of view of a square image; others have its diagonal.
        fov_spread_degrees: range of the field of view above `fov_degrees`; each scene samples its
            own, uniformly.
        principal_point, pixel_aspect, projection: as in `camera.Lens`.
        stereo: distance between the cameras of a stereo pair; 0 for single cameras. Each view is
            then followed by a view whose camera is moved along its x axis.
        truth: additional ground truth, some of TRUTHS (`rooms.truth`).
    """

    seed: int = setting(0)
    height: int = setting(128)
    width: int = setting(128)
    objects: tuple[int, int] = setting(
        # Object ids are stored as int8.
        (1, 3), "Number of objects in a scene", limits=(0, 100)
    )  # fmt: skip
    source: str = setting("shapes", choices=(*BUILT_IN, *FOLDERS))
    shapes: tuple[str, ...] = setting(DRAWN_SHAPES)
    object_split: str = setting("all", choices=SPLITS)
    listing: str = setting("")
    views: tuple[float, ...] = setting(
        (0.0,),
        "Views of each scene, such as 0,5,35,55,80. Each number is the angle in degrees by which"
        " the camera is rotated about the vertical axis",
    )
    spp: int = setting(
        1,
        "Number of samples per pixel for the colour. With --shading path, the default is 64",
        limits=(1, 1024),
    )
    image_dtype: str = setting("uint8", choices=IMAGE_DTYPES)
    min_visible_pixels: int = setting(
        FROM_SIZE,
        "Minimum number of visible pixels of each object in every view",
        shown="0.3% of the image",
    )
    fov_degrees: float = setting(28.0)
    fov_spread_degrees: float = setting(0.0, later=True)
    principal_point: tuple[float, float] = setting(
        (0.5, 0.5),
        "Principal point x,y, such as 0.3,0.6. x is a fraction of the width, and y of the height,"
        " from the upper left corner. Unless this is 0.5,0.5, images look like crops of larger"
        " images",
        later=True, shown="0.5,0.5",
    )  # fmt: skip
    pixel_aspect: float = setting(
        1.0, "Width of a pixel divided by its height", limits=(0.25, 4.0), later=True
    )
    projection: str = setting(
        "perspective",
        "equirectangular: panoramas of interiors, 360 x 180 degrees. The depth of a panorama is"
        " the distance along the ray. --size must be twice as wide as high, such as 256x512",
        choices=("perspective", "equirectangular"), later=True,
    )  # fmt: skip
    stereo: float = setting(
        0.0,
        "Distance between the two cameras of a stereo pair, such as 0.065, in scene units (metres"
        " in interiors). The second camera is to the right. 0: no stereo pairs",
        limits=(0.0, 0.25), later=True,
    )  # fmt: skip
    truth: tuple[str, ...] = setting(
        (),
        "Additional ground truth to store, comma-separated. amodal: masks of whole objects and"
        " their visible fractions; coordinates: object coordinates (NOCS); flow: optical flow to"
        " the next view, and a mask of occluded pixels; albedo: reflectance of each pixel; layers:"
        " the first 16 surfaces along each ray",
        later=True, option="with", shown="none",
    )  # fmt: skip

    def __post_init__(self) -> None:
        normalise(self)
        if self.min_visible_pixels == FROM_SIZE:
            least = max(1, round(VISIBLE_SHARE * self.height * self.width))
            object.__setattr__(self, "min_visible_pixels", least)
        check(0 <= self.seed < 2**63, "seed", self.seed, "a whole number from 0 to 2**63 - 1")
        for row in fields(self):
            _check_limits(row, getattr(self, row.name))
        _check_image(self)
        _check_objects(self)
        _check_views(self)
        _check_truth(self)

    @property
    def object_slots(self) -> int:
        """Length of the object axis of every array; at least 1, which HDF5 needs."""
        return max(1, self.objects[1])

    @property
    def view_angles(self) -> tuple[float, ...]:
        """Degrees from the input view to each image of a scene: one of `views`, or two of each."""
        eyes = 2 if self.stereo else 1
        return tuple(angle for angle in self.views for _ in range(eyes))

    @property
    def middle(self) -> tuple[float, float]:
        """Column and row of the principal point, in pixels from the upper left corner."""
        return self.principal_point[0] * self.width, self.principal_point[1] * self.height

    def lens(self, fov_y_degrees: float) -> "Lens":
        """Return the lens of images with this vertical field of view."""
        from scenegen.camera import Lens

        return Lens(fov_y_degrees, self.principal_point, self.pixel_aspect, self.projection)

    def fov_y(self, fov_degrees: float) -> float:
        """Return the vertical field of view with the diagonal of a square image's."""
        from scenegen.camera import Camera

        return Camera.fov_y_from_square(fov_degrees, self.height, self.width * self.pixel_aspect)

    def check_centred(self, where: Any) -> None:
        """Raise SpecError unless `Lens.is_centred`."""
        expected = "perspective images with square pixels around the principal point"
        check(self.lens(FOV[0]).is_centred, str(where), "other images", expected)

    @property
    def fov_y_degrees(self) -> float:
        """Vertical field of view; the diagonal is that of a square image with `fov_degrees`.

        Raises SpecError where scenes have different ones, and as `check_centred`.
        """
        self.check_centred("fov")
        widest = self.fov_degrees + self.fov_spread_degrees
        scenes = f"scenes of {self.fov_degrees:g} to {widest:g} degrees"
        check(widest == self.fov_degrees, "fov", scenes, "one field of view for all scenes")
        return self.fov_y(self.fov_degrees)

    def _json(self, more: dict[str, Any]) -> str:
        later = {row.name: row.default for row in fields(self) if row.metadata["later"]}
        kept = {name: value for name, value in vars(self).items() if later.get(name, ...) != value}
        return to_json({**more, **kept}, sort_keys=True)


@dataclass(frozen=True)
class DatasetSpec(RoomSpec):
    """A request for box rooms, as in the paper: a ground and two walls, with objects on the ground.

    Attributes:
        object_radius: smallest and largest bounding radius of an object, scene units.
        pose: "resting" puts each object in a stable position; "any" rotates it uniformly on SO(3)
            and lowers it until it touches the ground.
        lights: fewest and most point lights.
        shading: "paper" for the paper's equation, "path" for a path tracer on the same scene.
        shadows: whether lights are occluded (the paper's shading equation has no visibility term).
        allow_cropped: allow objects that the image border crops (centres stay in the image).
        camera_radius: distance from camera to target, scene units.
        camera_target: the fixed point of the room that cameras look at, world.
        light_radius: distance from the target to each light, scene units.
        light_level: radiance of a white surface at the target that faces all lights, ambient apart.
        ambient: the RGB of L_a.
        attenuation: k_l and k_q of the shading equation.
        light_saturation: RGB of each light is sampled from 1 - this to 1, then scaled to maximum 1.
        reflectance, room_reflectance: the RGB of rho, of objects and of the room.
        random_reflectance: sample the reflectance of each object, from 0.15 to 0.95 per channel.
        specular, shininess: ranges of Phong's k_s and exponent of objects; the room is matte.
        own_reflectance: multiply the reflectance of objects by the colours of their files; the
            ground truth then has "albedo".

    The other settings are those of `RoomSpec`.
    """

    interior: ClassVar[bool] = False

    object_radius: tuple[float, float] = setting(
        (0.11, 0.22),
        "Bounding radius of objects in scene units. With several --views, the default is 25%"
        " smaller",
        limits=(0.005, 0.5),
    )
    pose: str = setting(
        "resting",
        "resting: objects lie in a stable position on the floor; any: random orientation",
        choices=("resting", "any"),
    )
    lights: tuple[int, int] = setting((1, 3), "Number of lights in a scene", limits=(0, MAX_LIGHTS))
    shading: str = setting(
        "paper",
        "paper: shading equation of the Pix2Shape paper; path: path tracing, which is slower but"
        " has shadows and indirect light",
        choices=("paper", "path"),
    )
    shadows: bool = setting(False, "Let objects cast shadows", option="shadows/--no-shadows")
    allow_cropped: bool = setting(False, "Allow objects that the image border crops")
    camera_radius: float = setting(1.5, "Distance of the cameras from the target, in scene units")
    camera_target: Vector3 = setting((0.3, 0.3, 0.3))
    light_radius: float = setting(2.5, "Distance of the lights from the target, in scene units")
    light_level: float = setting(
        0.95,
        "Brightness of the lights: the radiance of a white surface that is at the target and faces"
        " every light",
        limits=(0.0, 100.0),
    )
    ambient: Vector3 = setting((0.1, 0.1, 0.1), "Radiance of the ambient light, L_a")
    attenuation: tuple[float, float] = setting(
        (0.5, 0.5),
        "Attenuation k_l,k_q of light: k_l is linear in the distance, k_q quadratic",
        shown="0.5,0.5",
    )
    light_saturation: float = setting(
        0.7, "Colour saturation of the lights, from 0 (white) to 1", limits=(0.0, 1.0)
    )
    reflectance: Vector3 = setting((0.8, 0.8, 0.8))
    room_reflectance: Vector3 = setting((0.8, 0.8, 0.8), "Reflectance of floor and walls")
    random_reflectance: bool = setting(
        False,
        "Give each object a random reflectance, or give all objects the same reflectance",
        option="random-reflectance/--same-reflectance",
    )
    specular: tuple[float, float] = setting(
        (0.0, 0.0), "Phong coefficient k_s of the objects", limits=(0.0, 10.0)
    )
    shininess: tuple[float, float] = setting(
        (1.0, 1.0), "Phong exponent of the objects", limits=(1.0, 10_000.0)
    )
    own_reflectance: bool = setting(False, later=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("ambient", "reflectance", "room_reflectance"):
            color = getattr(self, name)
            ok = len(color) == 3 and all(0.0 <= c <= 1.0 for c in color)
            check(ok, name.replace("_", " "), color, "channels from 0 to 1")
        allowed = "one of the two: a path tracer always casts shadows"
        both = self.shadows and self.shading == "path"
        check(not both, "shadows", "with shading 'path'", allowed)
        _check_places(self)
        _check_own_reflectance(self)

    @property
    def light_slots(self) -> int:
        """Length of the light axis of every array; at least 1, which HDF5 needs."""
        return max(1, self.lights[1])

    def seen_enough(self, visible: "NDArray[Any]", count: "NDArray[Any]") -> "NDArray[np.bool_]":
        """Return whether images show enough of their objects, (B,): all of them.

        Args:
            visible: pixels of each object, (B, K).
            count: of objects of each image, (B,).
        """
        return _seen(visible, count, self.min_visible_pixels) >= count

    def to_json(self) -> str:
        """Return the request as one line of JSON with sorted keys."""
        return self._json({})


@dataclass(frozen=True)
class InteriorSpec(RoomSpec):
    """A request for closed rooms with furniture, in metres (`description.interiors`).

    Attributes:
        hours: earliest and latest hour of the day; each scene samples its own, uniformly.
        denoise: whether images are denoised.
        sensor_noise: standard deviation of the noise that is added to images, relative to white.
        materials: hash of a folder of materials; empty for procedural materials.
        environment: hash of an environment map; empty for sun and sky.

    The other settings are those of `RoomSpec`. Class attributes answer for settings of
    `DatasetSpec` that the renderer asks for.
    """

    interior: ClassVar[bool] = True
    shading: ClassVar[str] = "path"
    shadows: ClassVar[bool] = False
    own_reflectance: ClassVar[bool] = False
    specular: ClassVar[tuple[float, float]] = (0.0, 0.0)
    shininess: ClassVar[tuple[float, float]] = (1.0, 1.0)
    lights: ClassVar[tuple[int, int]] = (1, 3)  # unused slots, which files of 1.0 have
    light_slots: ClassVar[int] = 3

    objects: tuple[int, int] = setting(
        # Cameras look at something, and the shell is cast as one more object.
        (1, 3), limits=(1, 99)
    )  # fmt: skip
    hours: tuple[float, float] = setting(
        (7.0, 21.0),
        "Hour of the day in interiors. With a range, each scene has its own hour. After 18, it is"
        " dark outside",
        limits=(0.0, 24.0),
        later=True,
    )
    denoise: bool = setting(
        False,
        "Denoise the images of interiors",
        later=True, option="denoise/--no-denoise", shown="if the extra `denoise` is installed",
    )  # fmt: skip
    sensor_noise: float = setting(
        0.0,
        "Standard deviation of the sensor noise in images of interiors, as a fraction of white",
        limits=(0.0, 1.0),
        later=True,
    )
    materials: str = setting("", later=True)
    environment: str = setting("", later=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        classes = "none: interiors are furnished with classes (--classes)"
        check(self.source != "shapes", "shapes", "given with interiors", classes)

    def seen_enough(self, visible: "NDArray[Any]", count: "NDArray[Any]") -> "NDArray[np.bool_]":
        """Return whether images show LEAST_SEEN of their objects, or all; as in `DatasetSpec`."""
        return _seen(visible, count, self.min_visible_pixels) >= count.clip(max=LEAST_SEEN)

    def to_json(self) -> str:
        """Return the request as one line of JSON with sorted keys.

        Files of 1.0 name the settings of the paper's rooms too, at their defaults.
        """
        return self._json({**_PAPER_ONLY, "shading": self.shading, "interior": True})


Request: TypeAlias = DatasetSpec | InteriorSpec
_SHARED = {row.name for row in fields(RoomSpec)}
_PAPER_ONLY = {  # settings of 1.0 that mean nothing in closed rooms
    row.name: row.default
    for row in fields(DatasetSpec)
    if row.name not in _SHARED and not row.metadata["later"]
}


def request_from_json(text: str) -> Request:
    """Read what `to_json` of either request wrote. Raises SpecError on anything else."""
    if '"interior"' in text and len(text) <= LONGEST_JSON:
        with suppress(ValueError, RecursionError):  # `from_json` tells what is wrong
            settings = json.loads(text)
            unused = json.loads(to_json({**_PAPER_ONLY, "shading": "path"}))
            if isinstance(settings, dict) and settings.pop("interior", None) is True:
                kept = {k: v for k, v in settings.items() if k not in unused or v != unused[k]}
                return from_json(InteriorSpec, json.dumps(kept), "dataset spec")
    return from_json(DatasetSpec, text, "dataset spec")


def _seen(visible: "NDArray[Any]", count: "NDArray[Any]", least: int) -> "NDArray[np.int64]":
    """Return how many objects of each image show so many pixels, (B,)."""
    import numpy as np

    slots = np.arange(visible.shape[1])
    return np.asarray(((visible >= least) & (slots < count[:, None])).sum(axis=1))


def _check_limits(row: "Field[Any]", value: Any) -> None:
    """Check a setting by itself, where two numbers or a few words limit it."""
    name, limits = row.name.replace("_", " "), row.metadata["limits"]
    choices = row.metadata["choices"]
    if choices:
        check_choice(name, value, choices)
    elif limits and isinstance(value, tuple):
        check_range(name, value, *limits)
    elif limits:
        check(limits[0] <= value <= limits[1], name, value, "from {:g} to {:g}".format(*limits))


def _check_image(spec: RoomSpec) -> None:
    check_range("fov", (spec.fov_degrees, spec.fov_degrees + spec.fov_spread_degrees), *FOV)
    sides, pixels = f"{spec.height}x{spec.width}", spec.height * spec.width
    check(min(spec.height, spec.width) >= 8, "size", sides, "at least 8 pixels a side")
    check(pixels <= MAX_PIXELS, "size", sides, f"at most {MAX_PIXELS:,} pixels")
    point = spec.principal_point
    near = len(point) == 2 and all(abs(x - 0.5) <= FARTHEST for x in point)
    check(near, "principal point", point, f"x,y from {0.5 - FARTHEST:g} to {0.5 + FARTHEST:g}")
    _check_panorama(spec)
    least = spec.min_visible_pixels
    expected = f"from 0 to the image's {pixels} pixels"
    check(0 <= least <= pixels, "min visible pixels", least, expected)


def _check_panorama(spec: RoomSpec) -> None:
    if spec.projection == "perspective":
        return
    expected = "interiors, which surround the camera"
    check(isinstance(spec, InteriorSpec), "projection", "a panorama of an open room", expected)
    least = min(spec.height, spec.width)
    expected = f"height x width of a panorama, such as {least}x{2 * least}"
    check(spec.width == 2 * spec.height, "size", f"{spec.height}x{spec.width}", expected)
    of_planes = {
        "flow": "flow" in spec.truth,
        "layers": "layers" in spec.truth,
        "stereo": spec.stereo > 0,
        "principal point": spec.principal_point != (0.5, 0.5),
        "pixel aspect": spec.pixel_aspect != 1,
    }
    for name, asked in of_planes.items():
        check(not asked, name, "with a panorama", "a perspective camera")


def _check_objects(spec: RoomSpec) -> None:
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
    both = len(spec.attenuation) == 2 and all(0.0 <= k <= 100.0 for k in spec.attenuation)
    check(
        both and sum(spec.attenuation) >= 1e-6,
        "attenuation",
        spec.attenuation,
        "k_l and k_q from 0 to 100, not both 0",
    )


def _check_views(spec: RoomSpec) -> None:
    views = spec.views
    rising = all(a < b for a, b in itertools.pairwise(views))
    check(
        0 < len(views) <= MAX_VIEWS and views[0] == 0 and rising and views[-1] <= MOST_TURN,
        "views",
        ", ".join(f"{v:g}" for v in views) or "none",
        f"rising degrees from 0, the input view, to at most {MOST_TURN:g}, such as 0,5,35,55,80",
    )


def _check_own_reflectance(spec: DatasetSpec) -> None:
    if spec.own_reflectance:
        where, meshes = "own reflectance", "meshes from a folder"
        check(spec.source in FOLDERS, where, spec.source, meshes)
        check(spec.shading == "paper", where, f"shading {spec.shading}", "shading 'paper'")
        both = "one of own and random reflectance"
        check(not spec.random_reflectance, where, "with random reflectance", both)
        object.__setattr__(spec, "truth", (*spec.truth, "albedo"))
        _check_truth(spec)


def _check_truth(spec: RoomSpec) -> None:
    wrong = [name for name in spec.truth if name not in TRUTHS]
    check(not wrong, "truth", ", ".join(wrong), f"some of {', '.join(TRUTHS)}")
    object.__setattr__(spec, "truth", tuple(name for name in TRUTHS if name in spec.truth))
    expected = "two views or more, such as --views 0,35"
    check("flow" not in spec.truth or len(spec.view_angles) > 1, "flow", "one view", expected)
