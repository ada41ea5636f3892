"""What is known of a question beside its images."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from scenegen.common.errors import FileFormatError

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class QuestionTruth:
    """What is known of a question's four images: the reference, then three answers.

    Attributes:
        cubes: integer coordinates, (4, n, 3) int8.
        shape_id: canonical shape of each image, 32 bytes; equal where a rotation takes one shape
            to the other.
        class_id: the same, mirror images as one.
        world_from_shape: rotation of each shape about its box's centre, (4, 3, 3).
        light_position: of each image's point lights, (L, 3) each, world, cube edges.
        light_color: of each image's point lights, (L, 3) each, radiance.
        distractor_kind: how each answer was made; None for the right one.
        angle_degrees: smallest rotation from the reference's view to the right answer's.
        visible_pixels: that show each cube, (4, n).
        depth: planar, (4, H, W), cube edges, NaN on the background; None where it is not stored.
    """

    cubes: Array
    shape_id: tuple[bytes, ...]
    class_id: tuple[bytes, ...]
    world_from_shape: Array
    light_position: tuple[Array, ...]
    light_color: tuple[Array, ...]
    distractor_kind: tuple[str | None, ...]
    angle_degrees: float
    visible_pixels: Array
    depth: Array | None


def question_truth(values: Mapping[str, Any], kind_names: Sequence[str]) -> QuestionTruth:
    """Build the record from one row of `layout.truth_columns`, padding cut off.

    Raises FileFormatError where a count or a kind is beyond its range.
    """
    cube_slots, light_slots = values["cubes"].shape[1], values["light_position"].shape[1]
    _check_range("cube_count", values["cube_count"], 1, cube_slots)
    _check_range("light_count", values["light_count"], 0, light_slots)
    _check_range("distractor_kind", values["distractor_kind"], -1, len(kind_names) - 1)
    cubes = int(values["cube_count"])

    def per_image(name: str) -> tuple[Array, ...]:
        pairs = zip(values[name], values["light_count"], strict=True)
        return tuple(lights[:count] for lights, count in pairs)

    return QuestionTruth(
        cubes=values["cubes"][:, :cubes],
        shape_id=tuple(row.tobytes() for row in values["shape_id"]),
        class_id=tuple(row.tobytes() for row in values["class_id"]),
        world_from_shape=values["world_from_shape"],
        light_position=per_image("light_position"),
        light_color=per_image("light_color"),
        distractor_kind=tuple(
            None if kind < 0 else kind_names[kind] for kind in values["distractor_kind"]
        ),
        angle_degrees=float(values["angle_degrees"]),
        visible_pixels=values["visible_pixels"][:, :cubes],
        depth=values.get("depth"),
    )


def _check_range(name: str, found: Array, low: int, high: int) -> None:
    if found.min() < low or found.max() > high:
        raise FileFormatError(f"{name}: found {found.tolist()}, expected {low} to {high}")
