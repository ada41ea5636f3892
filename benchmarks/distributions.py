"""Do two rooms files show scenes of the same distributions? Two-sample tests of what was drawn.

`python -m benchmarks.distributions BEFORE.h5 AFTER.h5`, for files of one request by two releases of
the sampler (or of two seeds). Only descriptions of scenes are read, so files of small images do:
`scenegen render --n 20000 --size 32 --min-visible-pixels 3 --preset albedo --out FILE`.
"""

import argparse
import json

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2_contingency, ks_2samp

from scenegen.common.rotations import rotation_matrix

Array = NDArray[np.float64]
DIGITS = 6  # after the point, of numbers that are compared
LEVEL = 0.01  # chance that files of one distribution are said to differ in something


def drawn(path: str) -> tuple[dict[str, Array], dict[str, list[str]]]:
    """Return what was drawn for the scenes of a file, by name: numbers, and what can be counted."""
    with h5py.File(path) as file:
        first = file["view_index"][:] == 0
        scenes = [json.loads(text) for text in file["scene"][:][first]]
    lights = [light for scene in scenes for light in scene["lights"]]
    items = [item for scene in scenes for item in scene["objects"]]
    points = {
        "camera": [scene["cameras"][0]["position"] for scene in scenes],
        "light": [light["position"] for light in lights],
        "light's colour": [light["color"] for light in lights],
        "object's place": [item["position"] for item in items],
        "object's colour": [item["reflectance"] for item in items],
    }
    numbers = {f"{name}, {axis}": values for name, some in points.items()
               for axis, values in zip(("x", "y", "z"), np.array(some).T, strict=True)}  # fmt: skip
    turns = rotation_matrix(np.array([item["rotation"] for item in items]).T)
    for row in range(3):
        for column in range(3):
            numbers[f"object's orientation, {row}{column}"] = turns[:, row, column]
    way_up = turns[:, 1, 1].round(DIGITS) + 0.0  # -0 is 0
    places = [[item["position"] for item in scene["objects"]] for scene in scenes]
    numbers["nearest two objects"] = np.array(
        [min(np.linalg.norm(np.subtract(a, b)) for a in some for b in some if a is not b)
         for some in places if len(some) > 1]
    )  # fmt: skip
    for name in ("scale", "specular", "shininess"):
        numbers[f"object's {name}"] = np.array([item[name] for item in items])
    kinds = [item["shape"].partition("/")[0] for item in items]
    return numbers, {
        "objects of a scene": [str(len(scene["objects"])) for scene in scenes],
        "lights of a scene": [str(len(scene["lights"])) for scene in scenes],
        "object's kind": kinds,
        "object's kind and way up": [
            f"{kind} {height:.1f}" for kind, height in zip(kinds, way_up.tolist(), strict=True)
        ],
    }


def p_values(before: str, after: str) -> dict[str, float]:
    """Return the p value of each test: Kolmogorov-Smirnov's, or chi-square of the counts."""
    (one, counted), (other, counted_too) = drawn(before), drawn(after)
    # A resting box has numbers that are 0 but for rounding, and rounding differs between releases.
    rounded = {
        name: (values.round(DIGITS), other[name].round(DIGITS)) for name, values in one.items()
    }
    found = {name: float(ks_2samp(*pair).pvalue) for name, pair in rounded.items()}
    for name, texts in counted.items():
        known = sorted({*texts, *counted_too[name]})
        table = np.array([[some.count(text) for text in known]
                          for some in (texts, counted_too[name])])  # fmt: skip
        enough = table.sum(axis=0) >= 20
        table = np.column_stack([table[:, enough], table[:, ~enough].sum(axis=1)])
        found[name] = float(chi2_contingency(table[:, table.any(axis=0)]).pvalue)
    return found


def main() -> None:
    """Print the p values, the smallest first, and whether one of them tells the files apart."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("before")
    parser.add_argument("after")
    paths = parser.parse_args()
    found = p_values(paths.before, paths.after)
    for name, value in sorted(found.items(), key=lambda pair: pair[1]):
        print(f"{value:.4f}  {name}")
    least = min(1.0, min(found.values()) * len(found))  # after Bonferroni
    told = "differ" if least < LEVEL else "do not differ"
    print(f"{len(found)} tests; the least p value times their number is {least:.3f}: they {told}")


if __name__ == "__main__":
    main()
