"""What a question file tells of one question, as a record: shapes, views, lights, answers."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from iqtt.questions.kinds import DISTRACTOR_KINDS
from iqtt.questions.specs import SplitSpec
from scenegen.camera import Camera

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class QuestionTruth:
    """What a file tells of the images of a question: the reference, then K answers.

    Attributes:
        cubes: integer coordinates, (1 + K, n, 3) int8.
        shape_id: identifier of the shape of each image, 32 bytes; equal if a rotation takes one
            shape to the other.
        class_id: the same, but equal for mirror images too.
        world_from_shape: rotation of each shape about the centre of its box, (1 + K, 3, 3).
        camera: the camera of all these images.
        light_position: positions of each image's point lights, (L, 3) each, world, cube edges.
        light_color: radiance of each image's point lights, RGB, (L, 3) each.
        distractor_kind: kind of each answer, such as "near"; None for the right one.
        angle_degrees: smallest rotation from the reference's view to the right answer's.
        visible_pixels: number of pixels that show each cube, (1 + K, n).
        depth: planar depth, (1 + K, H, W), cube edges, NaN on the background; None if not stored.
    """

    cubes: Array
    shape_id: tuple[bytes, ...]
    class_id: tuple[bytes, ...]
    world_from_shape: Array
    camera: Camera
    light_position: tuple[Array, ...]
    light_color: tuple[Array, ...]
    distractor_kind: tuple[str | None, ...]
    angle_degrees: float
    visible_pixels: Array
    depth: Array | None


def question_truth(values: Mapping[str, Any], spec: SplitSpec) -> QuestionTruth:
    """Return the record of one row of `layout.truth_columns`, without the padding."""
    cubes = int(values["cube_count"])

    def per_image(name: str) -> tuple[Array, ...]:
        pairs = zip(values[name], values["light_count"], strict=True)
        return tuple(lights[:count] for lights, count in pairs)

    return QuestionTruth(
        cubes=values["cubes"][:, :cubes],
        shape_id=tuple(row.tobytes() for row in values["shape_id"]),
        class_id=tuple(row.tobytes() for row in values["class_id"]),
        world_from_shape=values["world_from_shape"],
        camera=spec.camera(float(values["camera_distance"])),
        light_position=per_image("light_position"),
        light_color=per_image("light_color"),
        distractor_kind=tuple(
            None if kind < 0 else DISTRACTOR_KINDS[kind] for kind in values["distractor_kind"]
        ),
        angle_degrees=float(values["angle_degrees"]),
        visible_pixels=values["visible_pixels"][:, :cubes],
        depth=values.get("depth"),
    )
