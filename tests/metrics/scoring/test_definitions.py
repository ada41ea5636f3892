"""The page of definitions is enough: what follows it alone gets the numbers of `bench score`."""

import definitions
import h5py
import numpy as np
import pytest

from metrics.scoring.evaluate import score
from metrics.scoring.runs import Settings
from scenegen.description.presets import preset_spec
from scenegen.rooms.make import make_dataset

PRESETS = {
    "shapes": {"views": (0.0, 80.0)},
    "shapenet": {"height": 40},
    "shapes-single": {"allow_cropped": True, "fov_degrees": 40.0, "fov_spread_degrees": 40.0},
}


def make(preset, path, **settings):
    settings = {"height": 32, "width": 32, "seed": 8, **PRESETS[preset], **settings}
    make_dataset(path, preset_spec(preset, **settings), 3, command="tests")
    return path, definitions.read_truth(path)


@pytest.fixture(
    scope="session",
    params=["shapes", *(pytest.param(p, marks=pytest.mark.slow) for p in [*PRESETS][1:])],
)
def truth(request, tmp_path_factory):
    return make(request.param, tmp_path_factory.mktemp("definitions") / "rooms.h5")


def noisy(a, rng, size=0.02):
    return a + size * rng.standard_normal(a.shape)


def blurred(a):
    a = np.pad(np.nan_to_num(a, nan=1.0), ((0, 0), (1, 1), (1, 1)), mode="edge")
    height, width = a.shape[1] - 2, a.shape[2] - 2
    return sum(a[:, i : i + height, j : j + width] for i in range(3) for j in range(3)) / 9


def holes_filled(truth):
    """Objects give way to the farthest surface of their row of pixels."""
    far = np.nan_to_num(truth["depth"]).max(axis=2, keepdims=True)
    return np.where(truth["object_id"] > 0, far, truth["depth"])


def empty_room(truth):
    return np.stack([view.Z for view in truth["views"]])


def turned(rng, t):
    return noisy(t["points"], rng, 0.005) @ np.linalg.qr(rng.standard_normal((3, 3)))[0] + 0.3


# kind, alignment, and the predictions from the truth's arrays and random numbers
SUBMISSIONS = {
    "truth": ("depth", "none", lambda t, rng: t["depth"]),
    "noise": ("depth", "none", lambda t, rng: noisy(t["depth"], rng)),
    "scaled": ("depth", "scale", lambda t, rng: 1.7 * noisy(t["depth"], rng, 0.005)),
    "median": ("depth", "median_scale", lambda t, rng: 3 * noisy(t["depth"], rng, 0.05)),
    "affine": ("depth", "scale_shift", lambda t, rng: 0.4 * noisy(t["depth"], rng) + 2),
    "constant": ("depth", "none", lambda t, rng: np.full_like(t["depth"], 1.4)),
    "blurred": ("depth", "none", lambda t, rng: blurred(t["depth"])),
    "wild": ("depth", "none", lambda t, rng: noisy(t["depth"] - 1, rng, 0.5)),
    "disparity": ("disparity", None, lambda t, rng: 3 / noisy(t["depth"], rng, 0.01) + 1),
    "points": ("points", "none", lambda t, rng: noisy(t["points"], rng, 0.005)),
    "mirrored": ("points", "none", lambda t, rng: t["points"] * [-1, 1, 1]),
    "wide": ("points", "scale", lambda t, rng: t["points"] * [2, 2, 1]),
    "turned": ("points", "scale_shift", lambda t, rng: turned(rng, t)),
    "holes filled": ("depth", "none", lambda t, rng: holes_filled(t)),
    "empty room": ("depth", "none", lambda t, rng: empty_room(t)),
}


def write(path, truth, views, kind, alignment, predict):
    """Write a submission with plain h5py, rows in any order, some with normals and camera."""
    rng = np.random.default_rng(3)
    with h5py.File(truth) as file:
        arrays = {name: file[name][()] for name in ("depth", "normal", "object_id")}
        fov, fingerprint = file["camera/fov_y_degrees"][()], file.attrs["fingerprint"]
    arrays["views"] = views
    arrays["points"] = arrays["depth"][..., None] * np.stack([view.d for view in views])
    order = rng.permutation(len(views))
    with h5py.File(path, "w") as file:
        file.attrs.update(
            format="pix2shape-bench/predictions", format_version="1.0", task="rooms",
            method="definitions", truth_fingerprint=fingerprint,
        )  # fmt: skip
        if alignment:
            file.attrs["alignment"] = alignment
        file["row"] = order
        file[kind] = predict(arrays, rng)[order].astype("f4")
        if alignment != "none" or kind == "disparity":
            file["normal"] = noisy(3 * arrays["normal"], rng)[order].astype("f4")
            file["fov_y_degrees"] = noisy(fov, rng)[order]


def check(truth, submission, name):
    path, views = truth
    write(submission, path, views, *SUBMISSIONS[name])
    found = score([submission], path, Settings(processes=1, resamples=100))
    columns = {**found.columns, **found.items}
    columns = {column: v for column, v in columns.items() if not np.isnan(v).all()}
    expected = definitions.items(views, submission)
    assert columns.keys() == expected.keys()
    agree(columns, expected)
    means, skills = definitions.means(expected), definitions.skills(expected)
    agree({key: one.value for key, one in found.metrics.items()}, means)
    agree({key: one.value for key, one in found.skills.items()}, skills, 2e-5)  # rounding to 0


def agree(found, expected, near_zero=1e-6):
    wrong = {
        column: (values, expected.get(column))
        for column, values in found.items()
        if values != pytest.approx(expected.get(column), rel=1e-6, abs=near_zero, nan_ok=True)
    }
    assert wrong == {}


SLOW = ("noise", "scaled", "constant", "points", "wide", "holes filled")
NAMES = [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in SUBMISSIONS]


@pytest.mark.parametrize("name", NAMES)
def test_the_page_gives_the_numbers(name, truth, tmp_path):
    check(truth, tmp_path / "mine.h5", name)


@pytest.mark.slow
@pytest.mark.parametrize("preset", PRESETS)
def test_the_page_gives_the_numbers_of_other_rooms(preset, tmp_path):
    made = make(preset, tmp_path / "rooms.h5", seed=21, height=48, width=44)
    for number, name in enumerate(SUBMISSIONS):
        check(made, tmp_path / f"{number}.h5", name)
