"""One HTML file that asks people questions: pictures and a script, and no right answer of them."""

import base64
import hashlib
import io
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from iqtt.files.reader import NoAnswersError, QuestionsFile, answers_beside
from iqtt.perspective.specs import PerspectiveSpec
from scenegen.common.errors import SpecError
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.records import check
from scenegen.files.new_file import write_text
from scenegen.rooms.preview import srgb_bytes

QUESTIONS, PRACTICE = 20, 2  # the paper had 1 for practice
MOST_QUESTIONS = 1000
LARGEST = 512  # pixels of a side; larger images are made smaller by a whole factor
HASHED = 100  # questions of a released file, that tell it from others
HOME = Path(__file__).parent

PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="robots" content="noindex">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<title>A quiz</title>
<link rel="icon" href="data:,">
<style>{style}</style>
</head>
<body>
<main id="main"><p>This quiz needs JavaScript.</p></main>
<script type="application/json" id="quiz">{content}</script>
<script>{script}</script>
</body>
</html>
"""


@dataclass(frozen=True)
class Study:
    """What the participants of a quiz have in common.

    Attributes:
        questions: how many count; everyone gets the same ones, each in an order of their own.
        practice: questions before them whose right answers are told.
        seed: of the draw.
        contact: who runs the study; may be empty.
        post: address that takes the answers; may be empty.
    """

    questions: int = QUESTIONS
    practice: int = PRACTICE
    seed: int = 0
    contact: str = ""
    post: str = ""

    def __post_init__(self) -> None:
        most = MOST_QUESTIONS
        check(1 <= self.questions <= most, "questions", self.questions, f"from 1 to {most}")
        check(0 <= self.practice <= most, "practice", self.practice, f"from 0 to {most}")
        _origin(self.post)


def write_quiz(
    path: str | Path, out: str | Path, study: Study | None = None, overwrite: bool = False
) -> None:
    """Write the quiz about the questions of a file, such as iqtt-test.h5.

    Practice comes from the validation file beside it, where there is one. Otherwise questions of
    the file are kept for practice, which are then not asked.

    Raises OSError, FileFormatError and SpecError as `QuestionsFile`; NoAnswersError where questions
    for practice have no answers; SpecError where there are too few questions.
    """
    study = study or Study()
    with QuestionsFile(path) as file:
        practice, kept = _practice(file, Path(path), study)
        rows = np.setdiff1d(np.arange(len(file)), kept)
        check(study.questions <= len(rows), f"{path}: questions", len(rows),
              f"at least {study.questions}")  # fmt: skip
        rng = item_rng(study.seed, 0, Purpose.QUIZ)
        chosen = sorted(rng.choice(rows, study.questions, replace=False).tolist())
        digest = questions_digest(file)
        content = {
            "quiz": quiz_name(digest, chosen),
            "digest": digest,
            "contact": study.contact,
            "post": study.post,
            "about": "rooms" if isinstance(file.spec, PerspectiveSpec) else "cubes",
            "answers": file.answers,
            "practice": practice,
            "questions": [{"row": row, "pictures": _pictures(file, row)} for row in chosen],
        }
    write_text(out, _page(content, study.post), overwrite)


def quiz_name(digest: str, rows: Sequence[int]) -> str:
    """Return the name of the quiz that asks these questions of a file with this digest."""
    return hashlib.sha256(json.dumps([digest, sorted(rows)]).encode()).hexdigest()[:16]


def questions_digest(file: QuestionsFile) -> str:
    """Return the fingerprint of a table of questions; of a released one, SHA-256 of its images."""
    if file.fingerprint:
        return file.fingerprint
    content = hashlib.sha256()
    for row in range(0, len(file), max(1, len(file) // HASHED)):
        content.update(np.ascontiguousarray(file.read("questions", row)).tobytes())
    return content.hexdigest()


def _practice(
    file: QuestionsFile, path: Path, study: Study
) -> tuple[list[dict[str, Any]], list[int]]:
    """Return the questions for practice, and those rows of the file that are kept for it."""
    if study.practice == 0:
        return [], []
    beside, own = path.with_name(path.name.replace("test", "val")), False
    if beside == path or not beside.is_file() or not _is_of_same_split(file, beside, study):
        beside, own = path, True
    with QuestionsFile(beside, None, None if file.has_answers else _answers(path, own)) as source:
        count = len(source)
        check(study.practice <= count, f"{beside}: questions", count,
              f"at least {study.practice}, for practice")  # fmt: skip
        rng = item_rng(study.seed, 0, Purpose.QUIZ, attempt=1)
        rows = rng.choice(count, study.practice, replace=False).tolist()
        asked = [
            {"pictures": _pictures(source, row), "right": int(source.read("answers", row))}
            for row in rows
        ]
    return asked, rows if own else []


def _is_of_same_split(file: QuestionsFile, beside: Path, study: Study) -> bool:
    with QuestionsFile(beside) as other:
        specs = file.spec, other.spec
        same = all(specs) and specs[0].public() == specs[1].public()  # type: ignore[union-attr]
        return same and other.has_answers and len(other) >= study.practice


def _answers(path: Path, own: bool) -> Path | None:
    """Return the file of answers that questions for practice need; None for those that have some.

    Raises NoAnswersError where there is none.
    """
    answers = answers_beside(path) if own else None
    if own and answers is None:
        expected = f"{path.stem}-answers{path.suffix} next to it"
        hint = "--practice 0 leaves out practice"
        raise NoAnswersError(path, "practice questions without an answer key", expected, hint)
    return answers


def _pictures(file: QuestionsFile, row: int) -> list[str]:
    """Return the reference and the answers of a row as WebP files in base64."""
    return [base64.b64encode(webp(image)).decode() for image in file[row].radiance]


def webp(radiance: NDArray[Any]) -> bytes:
    """Return linear radiance, (H, W, 3), as a lossless WebP file in sRGB; NaN is black."""
    picture = Image.fromarray(srgb_bytes(np.nan_to_num(radiance)))
    factor = -(-max(picture.size) // LARGEST)
    out = io.BytesIO()
    (picture if factor == 1 else picture.reduce(factor)).save(out, "WEBP", lossless=True)
    return out.getvalue()


def _page(content: dict[str, Any], post: str) -> str:
    style, script = ((HOME / f"quiz.{end}").read_text(encoding="utf-8") for end in ("css", "js"))
    hashes = {
        name: base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        for name, text in (("style", style), ("script", script))
    }
    policy = (
        f"default-src 'none'; img-src data:; style-src 'sha256-{hashes['style']}';"
        f" script-src 'sha256-{hashes['script']}'; connect-src {_origin(post)}; base-uri 'none';"
        " form-action 'none'"
    )
    text = json.dumps(content, separators=(",", ":")).replace("<", "\\u003c")
    return PAGE.format(policy=policy, style=style, script=script, content=text)


def _origin(post: str) -> str:
    """Return what a page that posts there may connect to. Raises SpecError for no such address."""
    if not post:
        return "'none'"
    expected = "an address such as https://lab.example.org/answers, or /answers"
    error = SpecError("post", f"{post!r:.100}", expected)
    if not re.fullmatch(r"[!-~]+", post):
        raise error
    try:
        address = urlsplit(post)
        port = address.port
    except ValueError:
        raise error from None
    if not address.scheme and not address.netloc:
        return "'self'"  # beside the page
    place = address.hostname or ""
    if address.scheme not in ("http", "https") or not re.fullmatch("[a-z0-9.-]+", place):
        raise error
    return f"{address.scheme}://{place}" + (f":{port}" if port else "")
