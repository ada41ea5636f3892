"""`describe` tells what is in a question file, and tells it truly."""

import json
import re

import h5py
import numpy as np
import pytest

from iqtt.files.info import describe


def value(text, name):
    """Return what the first line tells that starts with a name."""
    return re.findall(rf"^\W*{re.escape(name)} {{2,}}(.+)$", text, re.MULTILINE)[0].strip()


def sections(path):
    """Return header, and the text of each table by its part."""
    header, *tables = re.split(r"^  (?=(?:\w+: )?\d+ questions)", describe(path), flags=re.M)
    return header, {re.match(r"(?:(\w+): )?", text)[1] or "": text for text in tables}


def test_header_and_settings(split_folder):
    path = split_folder / "iqtt-train.h5"
    header, tables = sections(path)
    with h5py.File(path) as file:
        root = dict(file.attrs)
    assert header.startswith(f"{path}: 12 questions, {path.stat().st_size / 1e6:.1f} MB")
    assert list(tables) == ["labeled", "unlabeled"]
    releases = [root[f"{name}_version"] for name in ("mitsuba", "drjit", "llvm")]
    for name, expected in {
        "format": "pix2shape-bench/iqtt 1.0",
        "content": root["content_digest"],
        "written by": f"{root['writer']}, {root['variant']}",
        "rendered by": "Mitsuba {}, Dr.Jit {}, LLVM {}".format(*releases),
        "split": "train",
        "command": "-",
        "conventions": root["conventions"],
    }.items():
        assert value(header, name) == expected
    for name, setting in json.loads(root["spec"]).items():
        told = ", ".join(map(str, setting)) if isinstance(setting, list) else str(setting)
        if name == "answers":  # there are two lines of this name
            assert "  answers         to 6 of them (50.0%)\n" in header
            continue
        assert value(header, name) == ("not told" if name == "seed" else told)
    changed = set(re.findall(r"^ +\* (\w+) ", header, re.MULTILINE))
    assert changed == {
        *("train", "labeled", "val", "test", "cubes", "lights", "height", "width"),
        *("min_cube_pixels", "with_depth"),
    }


@pytest.mark.parametrize("part", ["labeled", "unlabeled"])
def test_facts_are_those_of_the_file(split_folder, part):
    path = split_folder / "iqtt-train.h5"
    text = sections(path)[1][part]
    assert "6 questions of 4 images of 32x32, uint8" in text
    with h5py.File(path) as file:
        truth, images = file["truth"][part], file[part]["questions"][:]
        assert value(text, "fingerprint") == file.attrs[f"fingerprint_{part}"]
        if part == "labeled":
            assert value(text, "truth digest") == file.attrs["truth_digest_labeled"]
        for k, name in enumerate(("other", "near", "mirror")):
            count = (truth["distractor_kind"][:] == k).sum()
            assert (f"{name}: {count}" in value(text, "distractors")) == (count > 0)
        assert "-1" not in value(text, "distractors"), "the right answer is none"
        quartiles = np.quantile(truth["angle_degrees"][:], np.linspace(0, 1, 5))
        assert re.findall(r"\d+", value(text, "angle")) == [f"{q:.0f}" for q in quartiles]
        sizes = truth["cube_count"][:].tolist()
        expected = ", ".join(f"{n}: {sizes.count(n)}" for n in sorted(set(sizes)))
        assert value(text, "cubes a shape") == expected
        low, high = map(float, re.findall(r"[\d.]+", value(text, "radiance"))[:2])
        assert (low, high) == pytest.approx((images.min() / 255, images.max() / 255), rel=1e-3)
    assert ("answers  " in text) == (part == "labeled")
    if part == "labeled":
        assert value(text, "answers") == "0: 2, 1: 2, 2: 2"


def test_every_dataset_with_row_type_unit_and_size(split_folder):
    table = sections(split_folder / "iqtt-val.h5")[1][""].partition(" dataset ")[2]
    with h5py.File(split_folder / "iqtt-val.h5") as file:
        names = ["questions", "answers", *(f"truth/{name}" for name in file["truth"])]
        assert len(table.splitlines()) == len(names) + 1
        for name in names:
            dataset, line = file[name], value(table, name.split("/")[-1])
            stored = dataset.id.get_storage_size()
            row = "(" + ", ".join(map(str, dataset.shape[1:])) + ")"
            assert line.startswith(f"{row} ")
            assert line.endswith(f" {stored / 1e3:.1f} kB  {dataset.nbytes / stored:>6.1f}")
            assert f" {dataset.dtype} " in line
            assert dataset.attrs["unit"][:20] in line


def test_a_test_file_and_its_answers(split_folder, damaged):
    header, tables = sections(split_folder / "iqtt-test.h5")
    assert value(header, "answers") == "in iqtt-test-answers.h5"
    assert not re.search(r"distractors|angle|cubes a shape|world_from", tables[""])
    alone = damaged(lambda file: None, "iqtt-test.h5")
    assert value(describe(alone), "answers") == "none"
    header, known = sections(split_folder / "iqtt-test-answers.h5")
    assert value(header, "answers").startswith("to all of them")
    assert (value(header, "seed"), value(header, "command")) == ("5", "tests")
    assert value(known[""], "answers") == "0: 2, 1: 2, 2: 2"
    assert value(known[""], "fingerprint") == value(tables[""], "fingerprint")
    assert "distractors" in known[""]
    assert not re.search(r"^ +radiance ", known[""], re.MULTILINE)


def test_released_files(released):
    none = np.zeros(0, int)
    path = released("a.h5", {"labeled": (2, [2, 0]), "unlabeled": (6, None)})
    header, tables = sections(path)
    assert value(header, "answers") == "to 2 of them (25.0%)"
    assert "released" in value(header, "format")
    assert "spec" not in header
    assert "2 questions of 4 images of 20x24, float32" in tables["labeled"]
    assert value(tables["labeled"], "answers") == "0: 1, 2: 1"
    assert "over 6 questions" in value(tables["unlabeled"], "radiance")
    assert "fingerprint" not in "".join(tables.values())
    header, tables = sections(released("b.h5", {"labeled": (0, none), "unlabeled": (1, None)}))
    assert value(header, "answers") == "none"
    assert value(tables["labeled"], "questions").startswith("(4, 20, 24, 3)")
    assert ": 0 questions, " in describe(released("c.h5", {"": (0, None)}))
