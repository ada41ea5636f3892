"""Images of question files, and what is told with them."""

import numpy as np

from baselines.rezende import training
from baselines.rezende.rasteriser import rasterise
from iqtt import open_questions
from scenegen.objects.basic_shapes import unit_shape


def read_question_pictures(path, size, part=None):
    with open_questions(path, part) as questions:
        return training.read_question_pictures(questions, size)


def cubes_mesh(cubes, turn):
    """Return the cubes of a shape as one mesh, turned about the centre of their box."""
    triangles = unit_shape("box").triangles.reshape(-1, 3)
    corners = triangles / np.abs(triangles).max() / 2
    centre = (cubes.min(axis=0) + cubes.max(axis=0) + 1) / 2
    vertices = np.concatenate([corners + cube + 0.5 - centre for cube in cubes])
    faces = np.arange(len(vertices)).reshape(-1, 3)
    return vertices @ turn.T, faces


def test_true_shapes_drawn_with_what_is_told_are_the_images(split):
    pictures = read_question_pictures(split / "iqtt-val.h5", 64)
    assert len(pictures) == 12
    with open_questions(split / "iqtt-val.h5") as questions:
        for row in range(3):
            truth = questions.truth(row)
            for place in range(4):
                scale = pictures.views.distance / truth.camera.position[2]
                mesh, faces = cubes_mesh(truth.cubes[place], truth.world_from_shape[place])
                mesh = scale * mesh
                views = pictures.views_of(np.array([4 * row + place]))
                image, depth = rasterise(mesh[None], faces, views)
                wanted = np.moveaxis(pictures.image[4 * row + place], 0, 2)
                true = scale * np.where(np.isnan(truth.depth[place]), np.inf, truth.depth[place])
                assert (np.isfinite(depth[0]) == np.isfinite(true)).mean() > 0.995
                both = np.isfinite(depth[0]) & np.isfinite(true)
                assert np.isclose(depth[0][both], true[both], atol=0.01).mean() > 0.98
                assert np.median(abs(image[0] - wanted)[both]) < 0.02  # light differs in a cube
