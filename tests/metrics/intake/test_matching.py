"""Files and rows: by number, by scene and view, by order; what does not fit is named."""

from pathlib import Path

import numpy as np
import pytest

from metrics.intake.matching import MatchError, files_of, match_files

VIEWS = np.array([[scene, view] for scene in range(2) for view in range(2)])


def matched(names, count=4, **how):
    paths = [Path("out", name) for name in sorted(names)]
    return [path.name for path in match_files(paths, count, VIEWS[:count], **how).paths]


@pytest.mark.parametrize(
    "names",
    [
        ["0.png", "1.png", "2.png", "3.png"],
        ["1.png", "2.png", "3.png", "4.png"],
        ["a01b.npy", "a02b.npy", "a3b.npy",
                                                                "a0b.npy"],
        ["rooms2-000000-image.png", "rooms2-000001-image.png", "rooms2-000002-image.png",
         "rooms2-000003-image.png"],
        ["0_v2.exr", "1_v2.exr", "2_v2.exr", "3_v2.exr"],
        ["first0.png", "b 1.png", "c2.png", "3.png"],
    ],
)  # fmt: skip
def test_by_number(names):
    number = lambda name: [int(c) for c in "".join(x if x.isdigit() else " " for x in  # noqa: E731
                           name.replace("rooms2", "").replace("v2", "")).split()][-1]  # fmt: skip
    assert matched(names) == sorted(names, key=number)


def test_ten_comes_after_nine():
    names = [f"frame_{i}.png" for i in range(12)]
    paths = [Path(name) for name in sorted(names)]
    assert [path.name for path in match_files(paths, 12).paths] == names


def test_by_scene_and_view():
    names = ["s0_v0.png", "s0_v1.png", "s1_v0.png", "s1_v1.png"]
    assert matched(names) == names


def test_by_order_of_names():
    assert matched(["b.png", "a.png", "d.png", "c.png"], by="name") == [
        "a.png", "b.png", "c.png", "d.png",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["0.png", "1.png", "3.png"], "2"),
        (["0.png", "1.png", "2.png", "3.png", "4.png"], "4.png"),
        (["0.png", "1.png", "2.png", "9.png"], "9.png"),
        (["a_0.png", "a_1.png", "b_1.png", "a_2.png", "a_3.png"], "a_1.png and b_1.png"),
        (["0.png", "0.npy", "1.png", "2.png", "3.png"], "0.npy and 0.png"),
        (["0.png", "1.png", "2.png", "best.png"], "number"),
        (["0_9.png", "1_8.png", "2_7.png", "3_6.png"], "two numbers"),
    ],
)
def test_what_does_not_fit_is_named(names, words):
    with pytest.raises(MatchError) as caught:
        matched(names)
    assert words in str(caught.value)
    if len(names) != 4:
        with pytest.raises(MatchError):
            matched(names, by="name")


def test_files_of_a_folder_or_a_pattern(tmp_path):
    for name in ("1.png", "0.png", ".hidden", "0.npy"):
        (tmp_path / name).touch()
    (tmp_path / "deeper.png").mkdir()
    assert [path.name for path in files_of(str(tmp_path))] == ["0.npy", "0.png", "1.png"]
    assert [path.name for path in files_of(str(tmp_path / "*.png"))] == ["0.png", "1.png"]
    for nothing in (str(tmp_path / "deeper.png"), str(tmp_path / "*.exr"), ""):
        with pytest.raises(MatchError):
            files_of(nothing)
    for name in ("[ab]", "run[1]", "a*b"):  # what exists means itself
        (tmp_path / name / "in").mkdir(parents=True)
        for file in ("0.png", "[1].png"):
            (tmp_path / name / "in" / file).touch()
        for pattern in (f"{name}/in", f"{name}/in/*.png", f"{name}/i?/*"):
            assert len(files_of(str(tmp_path / pattern))) == 2, pattern
        assert len(files_of(str(tmp_path / name / "in" / "[1].png"))) == 1
    assert len(files_of(str(tmp_path / "[a-z]*" / "in" / "0.png"))) == 2
    (tmp_path / "notes.txt").touch()
    with pytest.raises(MatchError, match=r"notes\.txt"):
        files_of(str(tmp_path))
