"""Answers of a method that is given the depth of all images and how cameras moved: an oracle.

It carries each pixel of one image into the other camera, as novel views are made from depth. Where
the room is the same, no point then lies before the surface that is seen there. The oracle shows
that the questions about rooms can be answered from what both images show.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.files.reader import answers_beside, open_questions
from iqtt.perspective.columns import RoomTruth
from iqtt.perspective.specs import PerspectiveSpec
from metrics.prediction_writer import write_answers
from scenegen.camera import back_project, pixels_of, transform_points
from scenegen.common.errors import FileFormatError
from scenegen.common.threads import one_thread
from scenegen.description.scenes import SceneSpec
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import launch_fields

Array = NDArray[Any]
Progress = Callable[[int, int], Any]  # questions done since the last call, in all
TOLERANCE = 0.03  # share of the depth by which a point may lie before a surface


@one_thread()
def write_warp(
    data: str | Path,
    out: str | Path,
    *,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Answer the questions of a file that tells its scenes, from their exact depth.

    Scenes of test questions are read from the file of answers beside them.

    Raises FileFormatError for a file that does not tell scenes of rooms; else as `open_questions`
    and `write_answers`.
    """
    beside = answers_beside(data)
    with open_questions(data, answers=beside) as questions:
        spec, count = questions.spec, len(questions)
        if not isinstance(spec, PerspectiveSpec) or not questions.has_truth:
            expected = "a file of iqtt make-split --preset perspective with its answers"
            raise FileFormatError(data, "no scenes of rooms", expected)
        scores = np.zeros((count, questions.answers))
        for row in range(count):
            truth = questions.truth(row)
            assert isinstance(truth, RoomTruth)
            batch = pack(spec.interior(), truth.scenes)
            scores[row] = warp_scores(truth.scenes, launch_fields(batch, ["depth"])()["depth"])
            progress(1, count)
    write_answers(out, data, method="oracle-warp", scores=scores, overwrite=overwrite,
                  notes="given depth and cameras of all images")  # fmt: skip


def warp_scores(scenes: tuple[SceneSpec, ...], depth: Array) -> Array:
    """Return how well each option agrees with the reference, (K,), at most 0.

    Args:
        scenes: of the reference and of K options, one camera each.
        depth: of their images, (1 + K, H, W).
    """
    reference, *options = scenes
    fov = reference.cameras[0].fov_y_degrees
    place = reference.cameras[0].world_from_camera
    scores = []
    for scene, shown in zip(options, depth[1:], strict=True):
        camera = scene.cameras[0].world_from_camera
        before = _before(depth[0], shown, np.linalg.inv(camera) @ place, fov)
        scores.append(-before - _before(shown, depth[0], np.linalg.inv(place) @ camera, fov))
    return np.array(scores)


def _before(depth: Array, other: Array, other_from_camera: Array, fov: float) -> float:
    """Return the share of an image's points that lie before what another image shows there.

    It is 1 where no point is in the other image.
    """
    from scipy.ndimage import minimum_filter

    points = transform_points(other_from_camera, back_project(depth, fov)).reshape(-1, 3)
    points = points[points[:, 2] < -0.1]  # NaN is not
    row, column, inside = pixels_of(points, depth.shape, fov)
    nearest = minimum_filter(np.where(np.isfinite(other), other, np.inf), 3)
    before = (-points[:, 2] < (1 - TOLERANCE) * nearest[row, column])[inside]
    return float(before.mean()) if inside.any() else 1.0
