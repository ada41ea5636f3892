"""The page of the quiz: its pictures are those of the file, and it tells no correct option."""

import base64
import io
import json
import re
import shutil

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from refusals import refused

import cli
from iqtt.files.reader import NoAnswersError, QuestionsFile
from iqtt.quiz.page import Study, questions_digest, quiz_name, write_quiz
from scenegen.common.errors import SpecError
from scenegen.rooms.preview import srgb_bytes

FEW = Study(questions=4, practice=1)


def content_of(page):
    text = page.read_text(encoding="utf-8")
    return json.loads(re.search('id="quiz">(.*?)</script>', text)[1])


def picture(text):
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(text))).convert("RGB"))


@pytest.fixture
def page(split_folder, tmp_path):
    words = "quiz", split_folder / "iqtt-test.h5", "--questions", 4, "--practice", 1
    path = tmp_path / "quiz.html"
    done = CliRunner().invoke(cli.iqtt, [*map(str, words), "--out", str(path)])
    assert done.exit_code == 0, done.output
    return path


def test_pictures_are_those_of_the_file(page, split_folder):
    content = content_of(page)
    rows = [question["row"] for question in content["questions"]]
    with QuestionsFile(split_folder / "iqtt-test.h5") as file:
        assert content["digest"] == file.fingerprint
        assert content["quiz"] == quiz_name(content["digest"], rows)
        assert len(set(rows)) == 4
        for question in content["questions"]:
            shown = [picture(text) for text in question["pictures"]]
            np.testing.assert_array_equal(shown, srgb_bytes(file[question["row"]].radiance))


def test_the_page_is_the_same_for_every_key(split_folder, tmp_path):
    """So nothing in it, not even an order, can tell a right answer."""
    pages = []
    for shift in range(3):
        folder = tmp_path / str(shift)
        folder.mkdir()
        for name in ("iqtt-test.h5", "iqtt-test-answers.h5", "iqtt-val.h5"):
            shutil.copy(split_folder / name, folder)
        with h5py.File(folder / "iqtt-test-answers.h5", "r+") as file:
            file["answers"][:] = (file["answers"][:] + shift) % 3
        write_quiz(folder / "iqtt-test.h5", folder / "quiz.html", FEW)
        pages.append((folder / "quiz.html").read_bytes())
    assert pages[0] == pages[1] == pages[2]
    content = content_of(tmp_path / "0" / "quiz.html")
    assert [set(question) for question in content["questions"]] == [{"row", "pictures"}] * 4
    rows = [question["row"] for question in content["questions"]]
    assert rows == sorted(rows)


def test_pictures_hold_nothing_but_pixels(page):
    content = content_of(page)
    for question in (*content["questions"], *content["practice"]):
        for text in question["pictures"]:
            data = base64.b64decode(text)
            assert (data[:4], data[8:16]) == (b"RIFF", b"WEBPVP8L")  # one chunk
            assert int.from_bytes(data[4:8], "little") + 8 == len(data)


def test_without_it_rows_are_kept_that_are_not_asked(split_folder, tmp_path):
    for name in ("iqtt-test.h5", "iqtt-test-answers.h5"):
        shutil.copy(split_folder / name, tmp_path)
    test, out = tmp_path / "iqtt-test.h5", tmp_path / "quiz.html"
    write_quiz(test, out, Study(4, practice=2))
    content = content_of(out)
    references = {content_["pictures"][0] for content_ in content["questions"]}
    assert len(references | {told["pictures"][0] for told in content["practice"]}) == 6
    with refused(SpecError, found="4", expected="at least 5"):
        write_quiz(test, out, Study(5, practice=2), overwrite=True)
    (tmp_path / "iqtt-test-answers.h5").unlink()
    with pytest.raises(NoAnswersError):
        write_quiz(test, out, Study(1, practice=1), overwrite=True)
    write_quiz(test, out, Study(6, practice=0), overwrite=True)
    assert content_of(out)["practice"] == []


def test_another_seed_draws_others_and_released_files_are_asked_too(
    released, split_folder, tmp_path
):
    rows = []
    for seed in range(3):
        out = tmp_path / f"{seed}.html"
        write_quiz(split_folder / "iqtt-test.h5", out, Study(2, 0, seed))
        rows.append([question["row"] for question in content_of(out)["questions"]])
    assert rows[0] != rows[1] or rows[1] != rows[2]
    path = released()
    write_quiz(path, tmp_path / "r.html", Study(2, 1))
    with QuestionsFile(path) as file:
        assert content_of(tmp_path / "r.html")["digest"] == questions_digest(file)


@pytest.mark.parametrize(
    ("post", "origin"),
    [
        ("", "'none'"), ("/answers", "'self'"), ("save.php", "'self'"),
        ("https://lab.example.org/a?b=1", "https://lab.example.org"),
        ("http://localhost:8001/", "http://localhost:8001"),
        ("ftp://x/", None), ("https://a b/", None), ("https://x;script-src *", None),
        ("javascript:alert(1)", None), ("//x.org/a", None), ("https://x:port/", None),
    ],
)  # fmt: skip
def test_a_page_may_send_answers_to_one_address_only(split_folder, tmp_path, post, origin):
    out = tmp_path / "quiz.html"
    if origin is None:
        with pytest.raises(SpecError):
            Study(post=post)
        return
    write_quiz(split_folder / "iqtt-test.h5", out, Study(2, 0, post=post, contact="</script>"))
    text = out.read_text()
    assert f"connect-src {origin};" in text
    assert text.count("</script>") == 2
    assert content_of(out)["contact"] == "</script>"


def test_practice_is_of_the_validation_file(page, split_folder):
    (told,) = content_of(page)["practice"]
    with QuestionsFile(split_folder / "iqtt-val.h5") as val:
        shown = picture(told["pictures"][1 + told["right"]])
        rights = [srgb_bytes(record.radiance[1 + record.answer]) for record in val]
    assert any(np.array_equal(shown, right) for right in rights)
