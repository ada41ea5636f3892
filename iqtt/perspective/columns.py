"""What files store of questions about furnished rooms, and the record of one of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from iqtt.perspective.specs import PerspectiveSpec
from iqtt.questions.kinds import DISTRACTOR_KINDS
from scenegen.description.scenes import SceneSpec
from scenegen.files.schema import Column
from scenegen.layout import DEVELOPED

Array = NDArray[Any]
CONVENTIONS = (
    "unit: metre; image i shows scene i, image 0 is the reference, the others the answers; world"
    " and camera of each scene as of interiors: right-handed, y up, the camera looks along -z;"
    " pixels: row 0 on top; see docs/perspective.md"
)
TASK = (
    "One answer shows the room of the reference, seen from elsewhere. Which one? All answers are"
    " seen from one place."
)


@dataclass(frozen=True, eq=False)
class RoomTruth:
    """What a file tells of the images of a question: the reference, then K answers.

    Attributes:
        scenes: of each image, with one camera.
        in_play: number of the object in which answers differ.
        visible_pixels, whole_pixels: pixels that show it, and would if nothing hid it, (1 + K,).
        exposure: how images were developed, (1 + K, 5).
        picture_seed: of surfaces and of the noise of images.
        distractor_kind: kind of each answer, such as "moved"; None for the right one.
        angle_degrees: between the lines of sight of the reference and the answers.
        depth: planar depth, (1 + K, H, W), metres; None if not stored.
    """

    scenes: tuple[SceneSpec, ...]
    in_play: int
    visible_pixels: Array
    whole_pixels: Array
    exposure: Array
    picture_seed: int
    distractor_kind: tuple[str | None, ...]
    angle_degrees: float
    depth: Array | None


def room_truth(values: Mapping[str, Any]) -> RoomTruth:
    """Return the record of one row of `room_columns`. Raises SpecError for a wrong scene."""
    return RoomTruth(
        scenes=tuple(SceneSpec.from_json(bytes(text).decode()) for text in values["scene"]),
        in_play=int(values["in_play"]),
        visible_pixels=values["visible_pixels"],
        whole_pixels=values["whole_pixels"],
        exposure=values["exposure"],
        picture_seed=int(values["picture_seed"]),
        distractor_kind=tuple(
            None if kind < 0 else DISTRACTOR_KINDS[kind] for kind in values["distractor_kind"]
        ),
        angle_degrees=float(values["angle_degrees"]),
        depth=values.get("depth"),
    )


def developed(spec: object) -> dict[str, str]:
    """Return what is said of images that are developed; nothing of those of radiance."""
    is_room = isinstance(spec, PerspectiveSpec) and spec.image_dtype == "uint8"
    return {"unit": DEVELOPED["unit"]} if is_room else {}


def room_columns(spec: PerspectiveSpec) -> list[Column]:
    """Return the columns of `truth`."""
    images = 1 + spec.answers
    kind = "of each answer, seen from the reference: -1 the right one, else an index into `names`"
    # fmt: off
    columns = [
        Column("scene", (images,), "text", "-", "-", "description of each image's scene, JSON"),
        Column("distractor_kind", (spec.answers,), "int8", "1", "-", kind,
               within=(-1, len(DISTRACTOR_KINDS) - 1), more={"names": list(DISTRACTOR_KINDS)}),
        Column("angle_degrees", (), "float64", "degree", "-",
               "difficulty: from the reference's line of sight to that of the answers, about the"
               " vertical axis", within=(0, 180)),
        Column("in_play", (), "int8", "1", "-", "id of the object in which answers differ",
               within=(1, 100)),
        Column("visible_pixels", (images,), "int32", "pixel", "-", "pixels that show this object"),
        Column("whole_pixels", (images,), "int32", "pixel", "-",
               "the same if nothing hid it, up to half an image beyond the border"),
        Column("exposure", (images, 5), "float64", "1", "-",
               "how images are developed: factor of radiance, factors of red, green and blue, and"
               " the exposed radiance that is white"),
    ]
    columns.append(Column("picture_seed", (), "int64", "1", "-", "of surfaces and image noise"))
    if spec.with_depth:
        columns.append(
            Column("depth", (images, spec.height, spec.width), "float32", "metre", "camera",
                   "planar depth; NaN where the ray meets nothing", own_chunk=True)
        )
    # fmt: on
    return columns
