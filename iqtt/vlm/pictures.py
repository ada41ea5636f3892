"""Pictures of questions for models: drawn anew from cubes and poses, in sRGB, with letters."""

import io
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from iqtt.files.reader import QuestionRecord
from iqtt.files.truth import QuestionTruth
from iqtt.questions.distractors import Shapes
from iqtt.questions.packing import Question, pack_questions
from iqtt.questions.specs import SplitSpec
from iqtt.vlm.prompt import LARGEST, SMALLEST
from iqtt.vlm.reading import LETTERS
from scenegen.common.records import check
from scenegen.rendering.renderer import launch_fields
from scenegen.rooms.preview import BACKGROUND, INK, srgb_bytes

Array = NDArray[Any]
FINER = 2  # a pixel is the mean of FINER x FINER rays
_CURVE = srgb_bytes(np.linspace(0.0, 1.0, 1 << 16))  # a table is 20 times faster than the power
PIXELS_AT_ONCE = 1 << 24  # rays of one launch, so that memory stays flat
REFERENCE = "Reference"


def draw_pictures(
    spec: SplitSpec, questions: Sequence[Question], size: int, device: str = "auto"
) -> Iterator[Array]:
    """Yield the pictures of each question: reference, then answers, (1 + K, H, W, 3) sRGB uint8.

    A pixel is the mean radiance of 2 x 2 rays, encoded as sRGB (IEC 61966-2-1).

    Args:
        questions: shapes, poses and lights; `stored_question` returns those of a file.
        size: of the shorter side, pixels.

    Raises SpecError for a size out of range, BackendError as `renderer.render`.
    """
    check(SMALLEST <= size <= LARGEST, "size", size, f"from {SMALLEST} to {LARGEST} pixels")
    shorter = min(spec.height, spec.width)
    height, width = (round(side * size / shorter) for side in (spec.height, spec.width))
    fine = replace(
        spec, height=FINER * height, width=FINER * width, image_dtype="float32", min_cube_pixels=0
    )
    images = 1 + spec.answers
    at_once = max(1, PIXELS_AT_ONCE // (images * fine.height * fine.width))
    for start in range(0, len(questions), at_once):
        batch = pack_questions(fine, questions[start : start + at_once])
        radiance = launch_fields(batch, ("image",), device)()["image"]
        rays = radiance.reshape(-1, height, FINER, width, FINER, 3)
        upper, lower = rays[:, :, 0], rays[:, :, 1]
        means = (upper[:, :, :, 0] + upper[:, :, :, 1] + lower[:, :, :, 0] + lower[:, :, :, 1]) / 4
        yield from encoded(means).reshape(-1, images, height, width, 3)


def stored_pictures(record: QuestionRecord, size: int) -> Array:
    """Return the images of a file as pictures, (1 + K, H, W, 3) sRGB uint8.

    Larger images are made smaller until their shorter side has `size` pixels; others stay.
    """
    pictures = srgb_bytes(np.nan_to_num(record.radiance))
    shorter = min(pictures.shape[1:3])
    if shorter <= size:
        return pictures
    height, width = (round(side * size / shorter) for side in pictures.shape[1:3])
    return np.stack([np.asarray(Image.fromarray(x).resize((width, height))) for x in pictures])


def encoded(radiance: Array) -> NDArray[np.uint8]:
    """Return linear radiance as sRGB, both (...); equal to `srgb_bytes` within a step."""
    steps = np.clip(radiance, 0.0, 1.0) * (len(_CURVE) - 1) + 0.5
    return np.asarray(_CURVE[steps.astype(np.int32)])


def stored_question(spec: SplitSpec, truth: QuestionTruth) -> Question:
    """Return what a file tells of a question, ready to be drawn."""
    images, most = 1 + spec.answers, spec.lights[1]
    position, color = np.zeros((2, images, most, 3))
    counts = np.array([len(lights) for lights in truth.light_position])
    for i, count in enumerate(counts.tolist()):
        position[i, :count] = truth.light_position[i]
        color[i, :count] = truth.light_color[i]
    kinds = np.zeros(spec.answers, np.int8)  # they make no difference to pictures
    return Question(
        index=0,
        attempt=0,
        shapes=Shapes(truth.cubes, kinds, 0),
        camera_distance=float(truth.camera.position[2]),
        world_from_shape=truth.world_from_shape,
        light_position=position,
        light_color=color,
        light_count=counts,
        angle_degrees=truth.angle_degrees,
    )


def composed(pictures: Array, with_reference: bool = True) -> Image.Image:
    """Return one picture: the reference above, the answers below with the letters A, B, C.

    Args:
        pictures: reference, then answers, (1 + K, H, W, 3) sRGB uint8.
        with_reference: False leaves the reference out, for a control.
    """
    count, (height, width) = len(pictures) - 1, pictures.shape[1:3]
    gap, label = max(8, width // 16), max(18, height // 10)
    row = height + label + gap
    wide = count * width + (count + 1) * gap
    sheet = Image.new("RGB", (wide, gap + row * (1 + with_reference)), BACKGROUND)
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(size=round(0.8 * label))

    def place(picture: Array, left: int, top: int, text: str) -> None:
        draw.text((left + width / 2, top + label / 2), text, fill=INK, font=font, anchor="mm")
        draw.rectangle((left - 1, top + label - 1, left + width, top + label + height), INK)
        sheet.paste(Image.fromarray(picture), (left, top + label))

    if with_reference:
        place(pictures[0], (wide - width) // 2, gap, REFERENCE)
    for k, picture in enumerate(pictures[1:]):
        left = gap + k * (width + gap)
        place(picture, left, gap + row * with_reference, LETTERS[k])
    return sheet


def png(picture: Array | Image.Image) -> bytes:
    """Return a picture, sRGB, as a PNG file."""
    image = picture if isinstance(picture, Image.Image) else Image.fromarray(picture)
    out = io.BytesIO()
    image.save(out, "PNG", compress_level=6)
    return out.getvalue()
