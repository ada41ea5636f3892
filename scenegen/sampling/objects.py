"""Which objects scenes show: how many, their classes, models and materials."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import SpecError
from scenegen.common.random.seeding import Purpose, item_numbers
from scenegen.description.specs import DatasetSpec
from scenegen.objects.catalogue import Objects, outline
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.solids import UnitShape

Array = NDArray[Any]
MAX_MODELS = 100  # models of a class drawn for one object before the class is given up


@dataclass(frozen=True, eq=False)
class Unplaced:
    """The objects of N items before they have sizes, orientations and places.

    Attributes:
        names: all models of all classes; `model` is an index into them.
        outlines: the drawn models without triangles, as placement needs them.
        count: of objects of each item, (N,) int32.
        model: (N, K) int32; -1 in unused slots.
        outline: index into `outlines`, (N, K); 0 in unused slots.
        mesh: digests of the models' files, (N, K) texts; empty for built-in objects.
        reflectance, gloss: rho, (N, K, 3), and Phong's k_s and exponent, (N, K, 2).
    """

    names: Sequence[str]
    outlines: tuple[UnitShape, ...]
    count: Array
    model: Array
    outline: Array
    mesh: Array
    reflectance: Array
    gloss: Array


def sample_counts(spec: DatasetSpec, index: Array) -> Array:
    """Draw the number of objects of each item, (N,) int32."""
    (number,) = item_numbers(spec.seed, index, Purpose.OBJECTS, count=1).T
    least, most = spec.objects
    return np.asarray(least + np.floor(number * (most - least + 1)), np.int32)


def sample_objects(spec: DatasetSpec, index: Array, objects: Objects) -> Unplaced:
    """Draw the objects of items `index`, (N,).

    For a model that cannot be used another one is drawn. Raises SpecError where no model of a class
    can be used.
    """
    slots = spec.object_slots
    count = sample_counts(spec, index)
    used = np.arange(slots) < count[:, None]
    kinds = item_numbers(spec.seed, index, Purpose.OBJECTS, start=2, count=slots)
    kind = np.floor(kinds * len(spec.shapes)).astype(np.int64)
    paint = item_numbers(spec.seed, index, Purpose.MATERIALS, count=5 * slots)
    paint = paint.reshape(-1, slots, 5)
    color = 0.15 + (0.95 - 0.15) * paint[..., :3] if spec.random_reflectance else spec.reflectance
    low, high = np.array([spec.specular, spec.shininess]).T
    names, first, models = _models(objects, spec.shapes)
    model = np.full(used.shape, -1, np.int32)
    problems: dict[int, str] = {}  # why models cannot be used
    outlines: dict[int, UnitShape] = {}
    for draw in range(MAX_MODELS):
        rows, columns = np.nonzero(used & (model < 0))
        if not len(rows):
            break
        chosen = kind[rows, columns]
        number = first[chosen]
        if (models[chosen] > 1).any():
            numbers = item_numbers(
                spec.seed, index[rows], Purpose.MODELS, columns, start=2 * draw, count=1
            )
            number += np.floor(numbers[:, 0] * models[chosen]).astype(np.int64)
        for i in np.unique(number).tolist():
            if i not in outlines and i not in problems:
                try:
                    outlines[i] = outline(objects.shape, names[i])
                except BadMeshError as error:
                    problems[i] = str(error)
        model[rows, columns] = np.where(np.isin(number, list(problems)), -1, number)
    else:
        row, column = np.argwhere(used & (model < 0))[0].tolist()
        raise SpecError(
            f"classes: {MAX_MODELS} meshes drawn from {spec.shapes[kind[row, column]]!r} cannot be"
            f" used, the last one because of {list(problems.values())[-1]}",
            hint="`scenegen check-objects` lists all problems",
        )
    drawn = sorted(outlines)
    digests = np.array(["", *(objects.digest(names[i]) for i in drawn)], object)
    place = np.where(used, np.searchsorted(drawn, model), -1)
    return Unplaced(
        names=names,
        outlines=tuple(outlines[i] for i in drawn),
        count=count,
        model=model,
        outline=np.maximum(place, 0),
        mesh=digests[place + 1],
        reflectance=np.where(used[..., None], color, 0.0),
        gloss=np.where(used[..., None], low + (high - low) * paint[..., 3:], (0.0, 1.0)),
    )


@lru_cache(maxsize=8)
def _models(objects: Objects, classes: tuple[str, ...]) -> tuple[tuple[str, ...], Array, Array]:
    """Return the names of all models of some classes, and where each class's begin; how many."""
    counts = np.array([len(objects.models[name]) for name in classes])
    names = tuple(model for name in classes for model in objects.models[name])
    return names, np.cumsum(counts) - counts, counts
