"""Cases follow from seed, target and number alone, and say in JSON what they are."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest

from fuzz.cases import EDITS, Case, draw
from fuzz.programs import Target

TARGET = Target("any", ("bench score a.h5 --truth b.json --out new.h5",), ("a.h5", "b.json"))


@pytest.fixture(scope="module")
def honest(tmp_path_factory):
    folder = tmp_path_factory.mktemp("honest")
    with h5py.File(folder / "a.h5", "w") as file:
        file.attrs["spec"] = json.dumps({"size": 3, "names": ["x"]})
        file["depth"] = np.ones((4, 3, 3), "f4")
        file["scene"] = ['{"lights": [1, 2]}'] * 4
    for name in ("b.json", "rooms.h5", "train.h5"):
        (folder / name).write_text('{"value": [1, 2, {"key": null}]}')
    return folder


def test_a_case_is_drawn_again_from_its_number(honest):
    cases = [draw(TARGET, 5, number, honest) for number in range(50)]
    assert cases == [draw(TARGET, 5, number, honest) for number in range(50)]
    assert len({case.to_json() for case in cases}) > 45
    assert cases[0] != draw(TARGET, 6, 0, honest)
    assert cases[0] != draw(replace(TARGET, name="other"), 5, 0, honest)


def test_a_case_is_the_same_from_json(honest):
    for number in range(50):
        case = draw(TARGET, 5, number, honest)
        assert Case.from_json(case.to_json()).to_json() == case.to_json()


def test_no_word_is_a_path_that_leads_out(honest):
    words = {word for i in range(300) for word in draw(TARGET, 5, i, honest).arguments}
    assert [word for word in words if word.startswith("/")] == []


def external(path):
    with h5py.File(path) as file:
        return file["depth"].external[0][0]


def depth(path):
    with h5py.File(path) as file:
        return file["depth"][()]


def scene(path):
    with h5py.File(path) as file:
        return json.loads(file["scene"][2])


@pytest.mark.parametrize(
    ("edit", "seen"),
    [
        (("a.h5", "store", "depth", "raw secret"), lambda path: external(path) == "/etc/passwd"),
        (("a.h5", "store", "depth", "unwritten"), lambda path: (depth(path) == 0).all()),
        (("a.h5", "pixels", "depth", [0.3], 1.0, "nan"),
         lambda path: np.isnan(depth(path)).sum() == 9),
        (("a.h5", "json_inside", "scene", "", 0.5, "set", 0.4, "number: -1"),
         lambda path: scene(path) == {"lights": -1}),
        (("b.json", "json_file", "remove", 0.3, ""), lambda path: path.read_text() == "{}"),
        (("b.json", "cut", 0.0, 1.0), lambda path: path.read_bytes() == b""),
        (("b.json", "become", "fifo"), lambda path: path.is_fifo()),
        (("b.json", "numeral", [[0.0, "nan"]]), lambda path: "[nan, 2" in path.read_text()),
    ],
    ids=lambda part: " ".join(map(str, part[1:])) if isinstance(part, tuple) else "seen",
)  # fmt: skip
def test_edits_do_what_they_say(honest, tmp_path, edit, seen):
    path, name, *arguments = edit
    (tmp_path / path).write_bytes((honest / path).read_bytes())
    EDITS[name](tmp_path / path, *arguments)
    assert seen(tmp_path / path)
