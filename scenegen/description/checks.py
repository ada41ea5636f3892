"""Which requests make sense: every setting of a `DatasetSpec`, and what they say together."""

import itertools
import math
from typing import TYPE_CHECKING

from scenegen.common.records import check, check_range
from scenegen.description.scenes import FAMILY_NAMES, SHAPE_NAMES

if TYPE_CHECKING:
    from scenegen.description.specs import DatasetSpec

IMAGE_DTYPES = ("uint8", "float16", "float32")
POSES = ("resting", "any")
BUILT_IN = {"shapes": SHAPE_NAMES, "families": FAMILY_NAMES}
FOLDERS = ("shapenet-v1", "shapenet-v2", "folder")
SPLITS = ("all", "train", "val", "test")
SHADINGS = ("paper", "path")
MAX_OBJECTS = 100  # object ids are stored as int8
MAX_CLASSES = 4000  # their names are an attribute, of which HDF5 allows 64 kB
MAX_LIGHTS = 16
MAX_PIXELS = 4096 * 4096
MAX_VIEWS = 64
MOST_TURN = 80.0  # degrees between two views: further, and the input views were all but one


def check_dataset_spec(spec: "DatasetSpec") -> None:
    """Raise SpecError, saying what was found and expected, where a setting makes no sense."""
    check(0 <= spec.seed < 2**63, "seed", spec.seed, "a whole number from 0 to 2**63 - 1")
    _check_image(spec)
    _check_objects(spec)
    _check_camera(spec)
    _check_light(spec)


def _one_of(name: str, value: str, known: tuple[str, ...]) -> None:
    check(value in known, name, value, f"one of {', '.join(known)}")


def _check_image(spec: "DatasetSpec") -> None:
    sides = f"{spec.height}x{spec.width}"
    check(min(spec.height, spec.width) >= 8, "size", sides, "at least 8 pixels a side")
    pixels = spec.height * spec.width
    check(pixels <= MAX_PIXELS, "size", sides, f"at most {MAX_PIXELS:,} pixels")
    _one_of("image dtype", spec.image_dtype, IMAGE_DTYPES)
    _one_of("shading", spec.shading, SHADINGS)
    check(1 <= spec.spp <= 1024, "spp", spec.spp, "from 1 to 1024")
    check(
        not (spec.shadows and spec.shading == "path"),
        "shadows",
        "with shading 'path'",
        "one of the two: a path tracer always casts shadows",
    )
    check(
        0 <= spec.min_visible_pixels <= pixels,
        "min visible pixels",
        spec.min_visible_pixels,
        f"from 0 to the image's {pixels} pixels",
    )


def _check_objects(spec: "DatasetSpec") -> None:
    check_range("objects", spec.objects, 0, MAX_OBJECTS)
    check_range("object radius", spec.object_radius, 0.005, 0.5)
    _one_of("pose", spec.pose, POSES)
    _one_of("source", spec.source, (*BUILT_IN, *FOLDERS))
    _one_of("object split", spec.object_split, SPLITS)
    what = "shapes" if spec.source == "shapes" else "classes"
    known = BUILT_IN.get(spec.source)
    some = f"some of {', '.join(known)}" if known else "names of classes"
    check(len(spec.shapes) > 0, what, "none", some)
    check(len(spec.shapes) <= MAX_CLASSES, what, len(spec.shapes), f"at most {MAX_CLASSES:,}")
    for name in spec.shapes:
        ok = name in known if known else name != "" and "/" not in name
        check(ok, what, repr(name), some)
    check(len(set(spec.shapes)) == len(spec.shapes), what, spec.shapes, "each name once")
    if spec.source == "shapes":
        check(spec.object_split == "all", "object split", spec.object_split, "'all' for shapes")
    check_range("specular", spec.specular, 0.0, 10.0)
    check_range("shininess", spec.shininess, 1.0, 10_000.0)


def _check_camera(spec: "DatasetSpec") -> None:
    check(1.0 <= spec.fov_degrees <= 120.0, "fov", spec.fov_degrees, "from 1 to 120 degrees")
    check(
        all(0.0 < x < 1.0 for x in spec.camera_target),
        "camera target",
        spec.camera_target,
        "inside the unit room",
    )
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


def _check_light(spec: "DatasetSpec") -> None:
    check_range("lights", spec.lights, 0, MAX_LIGHTS)
    check(0.0 <= spec.light_level <= 100.0, "light level", spec.light_level, "from 0 to 100")
    check(0.0 <= spec.light_saturation <= 1.0, "light saturation", spec.light_saturation, "0 to 1")
    for name in ("ambient", "reflectance", "room_reflectance"):
        color = getattr(spec, name)
        ok = len(color) == 3 and all(0.0 <= c <= 1.0 for c in color)
        check(ok, name.replace("_", " "), color, "channels from 0 to 1")
    check(
        len(spec.attenuation) == 2
        and all(0.0 <= k <= 100.0 for k in spec.attenuation)
        and sum(spec.attenuation) >= 1e-6,
        "attenuation",
        spec.attenuation,
        "k_l and k_q from 0 to 100, not both 0",
    )
