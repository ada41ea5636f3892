"""The page of a comparison: verdicts first, and pictures of files that were scored alone."""

from dataclasses import replace

import numpy as np
import pytest
from made_scores import iqtt_scores, rooms_scores
from pages import Page

from metrics.views.compare.compare import compare
from metrics.views.compare.report import AtHandError, html_comparison
from metrics.prediction_writer import RoomPredictionWriter
from metrics.scoring.evaluate import score
from scenegen.common.errors import FileFormatError
from scenegen.rooms.reader import RoomsFile

HOSTILE = "</title><script>alert(1)</script>"


def test_verdicts_come_first_and_names_stay_text():
    base = np.random.default_rng(0).gamma(2.0, 0.1, 20)
    columns = {"first": base, HOSTILE: base - 0.03, "same": base}
    scenes = np.repeat(np.arange(10), 2)
    files = [rooms_scores(name, {"chamfer": c}, scenes) for name, c in columns.items()]
    page = Page(html_comparison(compare(files, ["chamfer"]), files))
    words = " ".join("".join(page.words).split())
    assert f"{HOSTILE}: better in Chamfer." in words
    assert "same: no difference shown in Chamfer." in words
    assert words.index("better in Chamfer") < words.index("Differences")
    assert "script" not in page.tags
    assert "No pictures" in words
    row = next(row for row in page.rows if row[0].startswith(HOSTILE[:20]) and len(row) == 8)
    assert row[1].split()[0] == "-0.03000"
    assert row[-1] == "better"


def test_questions_are_compared_by_kind():
    files = [iqtt_scores("a", [1, 0, 1]), iqtt_scores("b", [1, 1, 1])]
    page = Page(html_comparison(compare(files), files))
    assert any(row[0] == "mirror" and row[1].startswith("0.6667") for row in page.rows)


def test_pictures_need_the_files_that_were_scored(rooms_path, tmp_path):
    paths = [tmp_path / "a.h5", tmp_path / "b.h5"]
    for path in paths:
        with (
            RoomsFile(rooms_path) as truth,
            RoomPredictionWriter(path, rooms_path, method="m") as out,
        ):
            for row in range(len(truth)):
                noise = 0.01 * (row + (path.name == "a.h5"))
                out.add(row, np.nan_to_num(truth.read("depth", row), nan=1.0) + noise)
    files = [score([path], rooms_path) for path in paths]
    compared = compare(files)
    moved = [path.rename(tmp_path / f"moved-{path.name}") for path in paths]
    assert "data:image/webp" not in html_comparison(compared, files, rooms_path)
    text = html_comparison(compared, files, rooms_path, moved)
    assert text.count("data:image/webp") == 6 * 6
    last = [replace(f, columns={**f.columns, "row": f.columns["row"] + 1}) for f in files]
    with pytest.raises(FileFormatError) as missing:
        html_comparison(compared, last, rooms_path, moved)
    assert missing.value.found.startswith("items.row")
    for truth, submissions in ((moved[0], moved), (rooms_path, [rooms_path])):
        with pytest.raises(AtHandError) as error:
            html_comparison(compared, files, truth, submissions)
        assert error.value.where == str(truth if truth == moved[0] else rooms_path)
