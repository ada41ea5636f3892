"""`info` tells what is in a file of rooms or of questions, and tells it truly."""

import json
import re

import h5py
import pytest

from iqtt.files import info as of_questions
from iqtt.files.make import make_split
from iqtt.questions.specs import SplitSpec
from scenegen import open_rooms
from scenegen.rooms import info as of_rooms


def value(text, name):
    """Return what the first line tells that starts with a name."""
    return re.findall(rf"^\W*{re.escape(name)} {{2,}}(.+)$", text, re.MULTILINE)[0].strip()


@pytest.fixture(scope="module")
def split(tmp_path_factory):
    folder = tmp_path_factory.mktemp("info") / "split"
    spec = SplitSpec(seed=5, train=9, labeled=3, val=2, test=3, cubes=(5, 7), height=32, width=32,
                     min_cube_pixels=2, with_depth=True)  # fmt: skip
    make_split(folder, spec, command="tests")
    return folder


@pytest.fixture(params=["rooms", "questions", "answers"])
def file(request, float_path, split):
    """Return a file, and what is told of it."""
    if request.param == "rooms":
        return float_path, of_rooms.describe(float_path)
    name = {"questions": "iqtt-train.h5", "answers": "iqtt-test-answers.h5"}[request.param]
    return split / name, of_questions.describe(split / name)


def test_facts_and_settings_are_those_of_the_file(file):
    path, text = file
    with h5py.File(path) as raw:
        root = dict(raw.attrs)
    releases = [root[f"{name}_version"] for name in ("mitsuba", "drjit", "llvm")]
    for name, expected in {
        "format": f"{root['format']} {root['format_version']}",
        "written by": f"{root['writer']}, {root['variant']}",
        "rendered by": "Mitsuba {}, Dr.Jit {}, LLVM {}".format(*releases),
        "command": root.get("creation_command", "-"),
        "conventions": root["conventions"],
    }.items():
        assert value(text, name) == expected
    for name in ("content_digest", *(x for x in root if re.match("fingerprint|truth_digest", x))):
        assert f" {root[name]}\n" in text
    text = text.partition("settings (")[2]
    for name, setting in json.loads(root["spec"]).items():
        shown = ", ".join(map(str, setting)) if isinstance(setting, list) else str(setting)
        assert value(text, name) == ("not stored" if setting is None else shown)


def test_ranges_of_rooms(float_path):
    """Few rows, so that all of them are read."""
    text = of_rooms.describe(float_path)
    with h5py.File(float_path) as raw:
        expected = {
            "radiance": raw["image"][:],
            "depth": raw["depth"][:],
            "n_z": raw["normal"][..., 2],
            "object_id": raw["object_id"][:],
        }
        texts = raw["scene"].id.get_storage_size()
    for name, array in expected.items():
        low, high = map(float, re.findall(rf"^ +{name} +(\S+) to (\S+)$", text, re.MULTILINE)[0])
        assert (low, high) == pytest.approx((array.min(), array.max()), rel=1e-3, abs=1e-3)
    with open_rooms(float_path) as rooms:
        shapes = [item.shape for room in rooms for item in room.scene.objects]
    assert all(f"{name} {shapes.count(name)}" in text for name in set(shapes))
    [(size, unit)] = re.findall(r"([\d.]+) (kB|MB)", value(text, "scene"))
    assert float(size) * {"kB": 1e3, "MB": 1e6}[unit] == pytest.approx(texts, abs=60)
