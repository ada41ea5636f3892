"""The paper's data sets and interiors, as settings; `scenegen presets` lists them."""

from dataclasses import dataclass, fields
from typing import Any

from scenegen.common.names import check_choice
from scenegen.common.records import check
from scenegen.description.names import FAMILY_NAMES, FURNITURE_NAMES
from scenegen.description.specs import DatasetSpec, InteriorSpec, Request

VESSELS = ("bag", "bottle", "bowl", "can", "cap", "lamp", "mug")
HOUSEHOLD = {"source": "families", "shapes": VESSELS}
PAPER_VIEWS = (0.0, 5.0, 35.0, 55.0, 80.0)  # degrees, as in the paper's table of unseen views
VIEWS_SHRINK = 0.75  # factor on object radii where several views must show objects whole
PATH_SAMPLES = 64  # colour samples per pixel of the path tracer, by default


@dataclass(frozen=True)
class Preset:
    """Settings under a name, and what they show."""

    meaning: str
    settings: dict[str, Any]
    kind: type[Request] = DatasetSpec


PRESETS = {
    "shapes": Preset("one to three basic shapes in a room", {}),
    "shapes-single": Preset("one basic shape", {"objects": (1, 1)}),
    "shapenet": Preset("two to four household objects", {**HOUSEHOLD, "objects": (2, 4)}),
    "shapenet-single": Preset(
        "one household object",
        {**HOUSEHOLD, "objects": (1, 1), "object_radius": (0.16, 0.26)},
    ),
    "furniture-256": Preset(
        "two or three thin-edged chairs and tables, 256x256",
        {
            "source": "families",
            "shapes": ("chair", "table"),
            "objects": (2, 3),
            "object_radius": (0.13, 0.22),
            "height": 256,
            "width": 256,
        },
    ),
    "specular": Preset(
        "basic shapes with Phong highlights",
        {"specular": (0.3, 0.8), "shininess": (8.0, 64.0), "reflectance": (0.5, 0.5, 0.5)},
    ),
    "two-tone": Preset(
        "objects in one colour, the room in another",
        {"reflectance": (0.85, 0.4, 0.3), "room_reflectance": (0.4, 0.6, 0.85)},
    ),
    "albedo": Preset("each object in a random colour", {"random_reflectance": True}),
    "random-lights": Preset(
        "one to five lights at random positions, in strong colours",
        {"lights": (1, 5), "light_saturation": 1.0},
    ),
    "interiors": Preset(
        "closed rooms with furniture in metres, path-traced with textures",
        {
            "source": "families",
            "shapes": FAMILY_NAMES + FURNITURE_NAMES,
            "objects": (12, 60),
            "spp": 8,
            "fov_degrees": 45.0,
            "fov_spread_degrees": 30.0,
            "height": 256,
            "width": 256,
        },
        InteriorSpec,
    ),
    "views": Preset("basic shapes seen from 0, 5, 35, 55 and 80 degrees", {"views": PAPER_VIEWS}),
}


def preset_spec(preset: str, **settings: Any) -> Request:
    """Return the request of a preset, with `settings` in place of the preset's own.

    Some settings that are not given follow from others: `object_radius` is smaller by VIEWS_SHRINK
    with several views, `spp` is PATH_SAMPLES for the path tracer, and `room_reflectance` is
    `reflectance` if that is given.

    Raises SpecError for an unknown preset, and for settings that are out of range or contradict
    one another.
    """
    check_choice("preset", preset, PRESETS)
    kind = PRESETS[preset].kind
    chosen = {**PRESETS[preset].settings, **_of_kind(kind, settings)}
    if kind is InteriorSpec:
        return InteriorSpec(**chosen)
    if len(chosen.get("views", ())) > 1 and "object_radius" not in settings:
        low, high = chosen.get("object_radius", DatasetSpec.object_radius)
        chosen["object_radius"] = (VIEWS_SHRINK * low, VIEWS_SHRINK * high)
    path = chosen.get("shading") == "path"
    check(not path or "shadows" not in settings, "shadows", "with shading 'path'", "one of the two")
    glossy = chosen.get("specular", (0, 0))[1] > 0
    check("shininess" not in settings or glossy, "shininess", "no specular", "both or neither")
    if path:
        chosen.setdefault("spp", PATH_SAMPLES)
    if "reflectance" in settings:
        chosen.setdefault("room_reflectance", settings["reflectance"])
    return DatasetSpec(**chosen)


def _of_kind(kind: type[Request], settings: dict[str, Any]) -> dict[str, Any]:
    """Return the settings without those of the other kind of rooms, which keep their defaults."""
    other = {DatasetSpec: InteriorSpec, InteriorSpec: DatasetSpec}[kind]
    names = {row.name for row in fields(kind)}
    for row in fields(other):
        if row.name in settings and row.name not in names:
            # A class attribute, such as the shading of interiors, stands for what is always so.
            usual, value = getattr(kind, row.name, row.default), settings[row.name]
            which = "interiors" if kind is InteriorSpec else "a preset other than interiors"
            check(value == usual, row.name.replace("_", " "), f"{value} with {which}", "none")
    return {name: value for name, value in settings.items() if name in names}
