"""Names of methods that could be taken for another's, or for a mark of the leaderboard's own.

Two names look alike if their skeletons are equal, after Unicode Technical Standard 39, section 4,
with compatibility forms (fullwidth letters, ligatures) unfolded and what shows nothing left out.
"""

import functools
import re
import unicodedata
from collections.abc import Iterator, Sequence

from metrics.leaderboard.floors import FLOOR, NOISE
from metrics.leaderboard.table import INCOMPARABLE_MARK, REPORTED_MARK
from metrics.report.paper_tables import TABLES
from metrics.scoring.records import ScoreFile
from scenegen.common.errors import SceneGenError

BASELINES = (
    *("constant", "mean-depth", "empty-room", "oracle", "chance", "outline", "outline-trees"),
    *(
        "pix2shape",
        "pix2shape-compact",
        "pix2shape-rays",
        "pix2shape-views",
        "cnn",
        "siamese",
        "ptn",
        "rezende",
        "depth-supervised",
        "view-pairs",
    ),
)
RENAME = "rename the method and score it again"
# Characters that show nothing although they count as letters, marks or symbols: joiners, fillers,
# a blank of Braille, an empty note, and selectors of variants.
_BLANK = {
    *map(ord, "\u034f\u115f\u1160\u17b4\u17b5\u180b\u180c\u180d\u180f\u2800\u3164\U0001d159"),
    *range(0xFE00, 0xFE10),
    *range(0xE0100, 0xE01F0),
}
_DAGGERS = {"DAGGER", "CROSS", "ALVEOLAR"}  # words in the names of what looks like our two marks


class LookAlikeError(SceneGenError):
    """A method's name that the leaderboard does not accept."""


def check_names(files: Sequence[ScoreFile]) -> None:
    """Raise LookAlikeError for a name that looks like another, or like a mark of the leaderboard.

    Names that are equal are told apart by their files, and letters may differ in case.
    """
    seen = {skeleton(name): (name, "the benchmark") for name in _known_names()}
    for file in files:
        mark = _own_mark(file.method)
        if mark:
            expected = f"a name without {mark}, as the leaderboard adds that itself"
            raise LookAlikeError(file.place, ascii(file.method), expected, RENAME)
        name, whose = seen.setdefault(skeleton(file.method), (file.method, file.place))
        if name != file.method:
            expected = f"a name that does not look like {name!a} of {whose}"
            raise LookAlikeError(file.place, ascii(file.method), expected, RENAME)


def skeleton(name: str) -> str:
    """Return what a name looks like: equal for names that differ by look-alikes only."""
    text = unicodedata.normalize("NFKD", name)
    seen = "".join(
        c
        for c in text
        if c.isspace() or not (unicodedata.category(c)[0] == "C" or ord(c) in _BLANK)
    )
    return unicodedata.normalize("NFD", " ".join(seen.translate(_look_alikes()).split()))


@functools.cache
def _look_alikes() -> dict[int, str]:
    """Return the text that stands for each character that looks like others."""
    from confusable_homoglyphs.confusables import confusables_data

    def partners(text: str) -> list[str]:
        return [entry["c"] for entry in confusables_data[text]]

    found = {}
    for text in confusables_data:
        first, *more = partners(text)
        if more:
            continue  # the one that stands for all its partners
        alone = len(partners(first)) == 1  # a pair: the longer one stands for both, or the later
        stands = max(text, first, key=lambda t: (len(t), t)) if alone else first
        # Texts that are read from the right come between two marks of the direction.
        bare = text.strip("\u200e")
        if len(bare) == 1:
            found[ord(bare)] = stands.strip("\u200e")
    return found


def _known_names() -> Iterator[str]:
    yield from BASELINES
    yield from (figure.method for table in TABLES for figure in table.figures)


def _own_mark(name: str) -> str:
    """Return which mark of the leaderboard a name has, or one that looks like it; or nothing."""
    if any(_DAGGERS.intersection(unicodedata.name(c, "").split()) for c in name):
        return f"{REPORTED_MARK} or {INCOMPARABLE_MARK}"
    if skeleton(name).startswith(tuple(map(skeleton, (FLOOR, NOISE)))):
        return f"{FLOOR.strip()} or {NOISE} before it"
    ending = _endings().search(skeleton(name))
    return "an ending such as [1], #1, (2 runs) or (claims depth when scaled)" if ending else ""


@functools.cache
def _endings() -> re.Pattern[str]:
    """What `text_table.distinct` and `ranking` put behind names: [file], #2, (2 runs)."""
    told = "|".join(map(skeleton, ("runs", "claims depth")))
    digits = "".join(map(skeleton, "0123456789"))
    return re.compile(rf"(\[[^\[\]]*\]|#[{digits}]+|\([^()]*\b({told})\b[^()]*\))$")
