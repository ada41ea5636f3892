"""Questions as public generators draw them, for `iqtt audit --cubes`.

    python -m benchmarks.public_sets spatialviz --out spatialviz.json

The generators are simulated from what their code does, not run; docs/public-sets.md names their
sources and what is simulated. Random numbers are ours, so that shares agree and questions do not.
"""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[Any]
View = tuple[Array, Array]  # cubes (n, 3) and the rotation (3, 3) to the camera's axes
Drawn = tuple[View, list[View]]  # the reference; the right answer, then the wrong ones
FACES = np.concatenate([np.eye(3, dtype=int), -np.eye(3, dtype=int)])
# stogiannidis/srbench, src/data_creation/mrt.py; microsoft/Mind-s-Eye, lib/mental_rotation_v2.py.
# A digit is a coordinate; TripleArm is moved by 1 along y, as its own has a -1.
SEVEN_SHAPES = {
    "Snake": "000 100 110 111 121 221 222 232",
    "Zigzag": "000 100 110 210 211 221 321 322",
    "SnakeComplex1": "000 100 200 210 211 221 121 131 132",
    "HookedCorner": "000 100 200 010 020 021 022",
    "TopPlate": "000 010 020 021 121 221",
    "CornerStaircase": "000 001 002 010 110 210 310 320 330",
    "TripleArm": "300 301 302 010 110 210 310 020 030",
}
EASY = ("Snake", "HookedCorner", "TopPlate", "CornerStaircase", "TripleArm")


def camera_axes(eye: Any, up: Any) -> Array:
    """Return the rotation (3, 3) to the axes of a camera at `eye` that looks at the origin."""
    z = np.asarray(eye, float) / np.linalg.norm(eye)
    x = np.cross(up, z) / np.linalg.norm(np.cross(up, z))
    return np.stack([x, np.cross(z, x), z])


def spatialviz(rng: np.random.Generator) -> Drawn:
    """Draw a stack in a 3 x 3 x 3 space, turned, flipped as a picture, and without a cube."""
    view = camera_axes((1, -1, 1), (0, 0, 1))
    cubes = _stack(rng)
    right = view @ _about(rng.integers(3), rng.choice([90, 180, 270]))
    # A flipped picture of a shape is a picture of its mirror image, seen in the mirror.
    mirror, flip = np.diag([-1, 1, 1]), np.diag([(-1, 1, 1), (1, -1, 1)][rng.integers(2)])
    less = view @ _about(rng.integers(3), rng.choice([0, 90, 180, 270]))
    fewer = np.delete(cubes, rng.integers(len(cubes)), axis=0)
    return (cubes, view), [(cubes, right), (cubes @ mirror, flip @ view @ mirror), (fewer, less)]


def _stack(rng: np.random.Generator) -> Array:
    """Return 8 to 10 cubes that stand on the ground or on each other, with bridges between."""
    while True:
        filled = rng.random((3, 3, 3)) < 0.5  # x, y, z
        filled = np.logical_and.accumulate(filled, axis=2)
        regions = _regions(filled[:, :, 0])
        for region, following in pairwise(regions):
            pairs = [(a, b) for a in region for b in following]
            a, b = min(pairs, key=lambda pair: np.abs(np.subtract(*pair)).sum())
            place = np.array(a)
            while (place != b).any():
                place += np.sign(b - place)
                filled[place[0], place[1], 0] = True
        if 8 <= filled.sum() <= 10:
            return np.argwhere(filled)


def _regions(ground: Array) -> list[list[tuple[int, int]]]:
    """Return the groups of squares that touch, at corners too, in the order of x and y."""
    left, regions = [(int(x), int(y)) for x, y in np.argwhere(ground)], []
    while left:
        region = [left.pop(0)]
        for x, y in region:
            near = [s for s in left if max(abs(s[0] - x), abs(s[1] - y)) <= 1]
            region += near
            left = [s for s in left if s not in near]
        regions.append(region)
    return regions


def seven_shapes(rng: np.random.Generator, kind: str) -> Drawn:
    """Draw a turned shape, mirror images of it, and another shape of the seven.

    Args:
        kind: "srbench-easy", "srbench-hard", or "minds-eye" for its easy half.
    """
    easy = kind != "srbench-hard"
    view = camera_axes((3**0.5 / 4, -0.75, 0.5), (0, 0, 1))  # azimuth -60, elevation 30 degrees
    shapes = {
        name: np.array([[*map(int, c)] for c in s.split()]) for name, s in SEVEN_SHAPES.items()
    }
    name = rng.choice(EASY if easy else list(shapes))
    other = rng.choice([key for key in shapes if key != name])
    cubes = shapes[name]

    def turned() -> Array:
        if easy:
            return _about(rng.integers(3), rng.choice([-90, 90, 180]))
        x, y, z = rng.choice([0, 60, 90, 120], 3)
        return _about(2, z) @ _about(1, y) @ _about(0, x)

    def turned_at_all() -> Array:
        while np.allclose(rotation := turned(), np.eye(3)):
            pass
        return rotation

    def mirrored() -> View:
        axis = 2 if easy else rng.integers(3)
        return cubes * np.where(np.arange(3) == axis, -1, 1), view @ turned()

    wrong = [mirrored(), (shapes[other], view @ turned_at_all())]
    wrong += [] if kind == "srbench-easy" else [mirrored()]
    return (cubes, view), [(cubes, view @ turned_at_all()), *wrong]


def _about(axis: int, degrees: float) -> Array:
    return Rotation.from_rotvec(np.eye(3)[axis] * np.radians(degrees)).as_matrix()


def spatialbench(rng: np.random.Generator) -> Drawn:
    """Draw ten cubes grown at random, and three shapes in which three cubes are moved."""
    cubes = np.zeros((1, 3), int)
    while len(cubes) < 10:
        cubes = _grown(rng, cubes)
    wrong = []
    for _ in range(3):
        shape = cubes
        for _ in range(3):
            rest = [np.delete(shape, k, axis=0) for k in range(len(shape))]
            shape = _grown(rng, rest[rng.choice([k for k, r in enumerate(rest) if _whole(r)])])
        wrong.append(shape)
    reference = camera_axes((1, 1, 1), (0, 1, 0))
    views = [(shape, _far_view(rng)) for shape in (cubes, *wrong)]
    return (cubes, reference), views


def _grown(rng: np.random.Generator, cubes: Array) -> Array:
    """Return the cubes and one more, which touches one of them."""
    while True:
        new = cubes[rng.integers(len(cubes))] + FACES[rng.integers(6)]
        if not (cubes == new).all(axis=1).any():
            return np.vstack([cubes, new])


def _whole(cubes: Array) -> bool:
    near = np.abs(cubes[:, None] - cubes).sum(axis=2) <= 1
    return bool((np.linalg.matrix_power(near.astype(int), len(cubes))[0] > 0).all())


def _far_view(rng: np.random.Generator) -> Array:
    """Return the view of a camera more than 0.8 radians from the reference's."""
    while True:
        azimuth, polar = rng.uniform(0, 2 * np.pi), rng.uniform(0, np.pi)
        eye = np.array(
            [np.sin(polar) * np.sin(azimuth), np.cos(polar), np.sin(polar) * np.cos(azimuth)]
        )
        if np.arccos(eye.sum() / 3**0.5) > 0.8:
            return camera_axes(eye, (0, 1, 0))


# The camera's distance in cube edges, None where rays are parallel.
SETS: dict[str, tuple[Any, float | None]] = {
    "spatialviz": (spatialviz, None),
    "srbench-easy": (lambda rng: seven_shapes(rng, "srbench-easy"), 30.0),
    "srbench-hard": (lambda rng: seven_shapes(rng, "srbench-hard"), 30.0),
    "minds-eye": (lambda rng: seven_shapes(rng, "minds-eye"), 30.0),
    "spatialbench": (spatialbench, 15.0),
}


def questions(name: str, count: int, seed: int) -> dict[str, Any]:
    """Return questions of a set as `iqtt audit --cubes` reads them; answers in random order."""
    draw, distance = SETS[name]
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(count):
        reference, answers = draw(rng)
        order = rng.permutation(len(answers))
        views = [
            {"cubes": cubes.tolist(), "rotation": rotation.tolist()}
            for cubes, rotation in [reference, *(answers[k] for k in order)]
        ]
        key = int(np.flatnonzero(order == 0)[0])
        made.append({"reference": views[0], "answers": views[1:], "key": key})
    return {"questions": made} | ({} if distance is None else {"camera_distance": distance})


@click.command()
@click.argument("name", type=click.Choice(list(SETS)))
@click.option("--n", default=1000, show_default=True, help="Number of questions.")
@click.option("--seed", default=0, show_default=True)
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), required=True)
def main(name: str, n: int, seed: int, out: Path) -> None:
    """Write questions of a public generator as cubes and rotations."""
    out.write_text(json.dumps(questions(name, n, seed)))


if __name__ == "__main__":
    main()
