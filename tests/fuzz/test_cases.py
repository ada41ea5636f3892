"""Cases follow from seed, target and number alone, and say in JSON what they are."""

import json

import h5py
import numpy as np
import pytest

from fuzz import cases, programs
from fuzz.cases import Case, drawn
from fuzz.edits import EDITS

LINES = ("bench score a.h5 --truth b.json --out new.h5",)


@pytest.fixture
def honest(tmp_path, monkeypatch):
    for module in (cases, programs):
        monkeypatch.setattr(module, "TARGETS", {"any": LINES, "other": LINES})
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["spec"] = json.dumps({"size": 3, "names": ["x"]})
        file["depth"] = np.ones((4, 3, 3), "f4")
        file["scene"] = ['{"lights": [1, 2]}'] * 4
    (tmp_path / "b.json").write_text('{"value": [1, 2, {"key": null}]}')
    return tmp_path


def test_a_case_is_drawn_again_from_its_number_and_from_json(honest):
    drawn_cases = [drawn("any", 5, number, honest) for number in range(50)]
    texts = [case.to_json() for case in drawn_cases]
    assert texts == [drawn("any", 5, number, honest).to_json() for number in range(50)]
    assert texts == [Case.from_json(text).to_json() for text in texts]
    assert len(set(texts)) > 45
    assert drawn_cases[0] not in (drawn("any", 6, 0, honest), drawn("other", 5, 0, honest))


def test_no_word_is_a_path_that_leads_out(honest):
    words = {word for i in range(300) for word in drawn("any", 5, i, honest).arguments}
    assert [word for word in words if word.startswith("/")] == []


def read(path, name):
    with h5py.File(path) as file:
        return file[name].external[0][0] if file[name].external else file[name][()]


@pytest.mark.parametrize(
    ("edit", "seen"),
    [
        (("a.h5", "store", "depth", "raw secret"),
         lambda path: read(path, "depth") == "/etc/passwd"),
        (("a.h5", "store", "depth", "unwritten"), lambda path: (read(path, "depth") == 0).all()),
        (("a.h5", "pixels", "depth", 0.3, 1.0, "nan"),
         lambda path: np.isnan(read(path, "depth")).sum() == 9),
        (("a.h5", "json_value", "scene", "set", 0.4, "number: -1"),
         lambda path: json.loads(read(path, "scene")[0]) == {"lights": -1}),
        (("b.json", "json_value", "", "remove", 0.3, "{}"), lambda path: path.read_text() == "{}"),
        (("b.json", "repeat", 0.0, 1.0, 0), lambda path: path.read_bytes() == b""),
        (("b.json", "become", "fifo"), lambda path: path.is_fifo()),
        (("b.json", "numeral", 0.0, "nan"), lambda path: "[nan, 2" in path.read_text()),
    ],
    ids=lambda part: " ".join(map(str, part[1:])) if isinstance(part, tuple) else "",
)  # fmt: skip
def test_edits_do_what_they_say(honest, edit, seen):
    path, name, *arguments = edit
    EDITS[name].change(honest / path, *arguments)
    assert seen(honest / path)
