"""Files and rows: by name, by number, by scene and view, by order; what does not fit is named."""

from pathlib import Path

import pytest

from metrics.intake.folders import MatchError, counted, files_of, match_files

VIEWS = [(scene, view) for scene in range(2) for view in range(2)]


def matched(names, count=4, by="number", rows=None):
    """The names of the files of the rows."""
    paths = [Path("out", name) for name in sorted(names)]
    rows = rows or [f"row {row}" for row in range(count)]
    keys = [*counted(count), VIEWS[:count]]
    return [path.name for path in match_files(paths, rows, lambda: keys, by)[0]]


@pytest.mark.parametrize(
    "names",
    [
        ["0.png", "1.png", "2.png", "3.png"],
        ["1.png", "2.png", "3.png", "4.png"],
        ["a0b.npy", "a01b.npy", "a02b.npy", "a3b.npy"],
        [f"rooms2-00000{row}-image.png" for row in range(4)],
        [f"{row}_v2.exr" for row in range(4)],
        ["first0.png", "b 1.png", "c2.png", "3.png"],
        [f"frame_{row}.png" for row in range(12)],  # 10 comes after 9
        ["s0_v0.png", "s0_v1.png", "s1_v0.png", "s1_v1.png"],
    ],
)
def test_by_number(names):
    assert matched(names, len(names)) == names


def test_by_name_and_by_order():
    names = ["b.png", "a.png", "d.png", "c.png"]
    assert matched(names, by="name") == sorted(names)
    assert matched(names, rows=[f"{letter}.jpg" for letter in "cadb"]) == [
        "c.png", "a.png", "d.png", "b.png",
    ]  # fmt: skip


NOT_BY_NUMBER = ("best.png", "0_9.png", "a_1.png and b_1.png", "0.npy and 0.png")


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["0.png", "1.png", "3.png"], "row 2"),
        (["1.png", "2.png", "4.png"], "row 2"),
        (["0.png", "1.png", "2.png", "3.png", "4.png"], "4.png"),
        (["0.png", "1.png", "2.png", "9.png"], "9.png"),
        (["a_0.png", "a_1.png", "b_1.png", "a_2.png", "a_3.png"], "a_1.png and b_1.png"),
        (["0.png", "0.npy", "1.png", "2.png", "3.png"], "0.npy and 0.png"),
        (["0.png", "1.png", "2.png", "best.png"], "best.png"),
        (["0_9.png", "1_8.png", "2_7.png", "3_6.png"], "0_9.png"),
    ],
)
def test_what_does_not_fit_is_named(names, words):
    with pytest.raises(MatchError) as caught:
        matched(names)
    assert words in f"{caught.value.where} {caught.value.found}"
    assert ("--match" in caught.value.hint) == (words in NOT_BY_NUMBER)
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
    with pytest.raises(MatchError) as caught:
        files_of(str(tmp_path))
    assert caught.value.found == "notes.txt"
