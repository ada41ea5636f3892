"""The files of a split: their names, and what they hold."""

import hashlib
from collections.abc import Mapping

from iqtt.files.layout import (
    FORMAT_NAME,
    FORMAT_VERSION,
    SCORED,
    answer_column,
    named,
    question_columns,
    root_attributes,
    truth_attributes,
    truth_columns,
)
from iqtt.questions.specs import SPLITS, SplitSpec
from iqtt.render import groups
from scenegen.files.row_file import writer_name
from scenegen.files.sets.plan import Bundle, Mark, Part, Plan, Sheet
from scenegen.layout import TRUTH_DIGEST

ANSWERS = "iqtt-test-answers.h5"
FILES = {
    "train": ("iqtt-train.h5",),
    "val": ("iqtt-val.h5",),
    "test": ("iqtt-test.h5", ANSWERS),
}  # of images, and of what is known of the questions
ALL_FILES = tuple(name for split in SPLITS for name in FILES[split])
# What tells questions apart; the answer is where the kind of distractor is -1.
FINGERPRINTED = ("cubes", "world_from_shape", "light_position", "light_color", "distractor_kind")


def split_plan(
    spec: SplitSpec, renderer: Mapping[str, str], compression: str, command: str, secret: bool
) -> Plan:
    """Return what the files of a split hold.

    Seed and command would reveal the test answers. So only the file of the test answers has them,
    and with `secret` it has no seed either.

    Args:
        renderer: Mitsuba's variant, and the versions that `rendering.backend.versions` gives.
        command: that made the split.
    """
    public = root_attributes(spec.public(), renderer, "")
    private = root_attributes(spec.public() if secret else spec, renderer, command)
    bundles = []
    for split, names in FILES.items():
        files = {
            name: {**(private if name == ANSWERS else public), "split": split} for name in names
        }
        parts = [
            split_part(spec, split, part, count, len(names) - 1)
            for part, (_, count) in groups(spec, split).items()
        ]
        bundles.append(Bundle(files, parts))
    settings = {
        "format_version": FORMAT_VERSION,
        "writer": writer_name(),
        "secret-seed": "yes" if secret else "no",
        "seed-check": _seed_check(spec),
        **renderer,
    }
    return Plan(FORMAT_NAME, spec.public().to_json(), settings, compression, bundles)


def split_part(spec: SplitSpec, split: str, name: str, count: int, truth: int) -> Part:
    """Return a part of a split: images in the first of its files, the rest in file `truth`."""
    with_answers = name != "unlabeled"
    sheets = [
        Sheet(question_columns(spec), 0, name),
        Sheet(truth_columns(spec), truth, f"truth/{name}".rstrip("/"), truth_attributes(spec)),
        *([Sheet([answer_column()], truth, name)] if with_answers else []),
    ]
    request = f"{spec.public().to_json()} {split} {name}"
    marks = [Mark(named("fingerprint", name), FINGERPRINTED, range(truth + 1), request)]
    if with_answers:
        marks.append(Mark(named(TRUTH_DIGEST, name), SCORED, [truth]))
    return Part(split, name, count, sheets, marks)


def _seed_check(spec: SplitSpec) -> str:
    """Return what tells two seeds apart, as hex.

    It does not help to find a seed: to try one takes longer here than to make a question from it.
    """
    salt = spec.public().to_json().encode()
    return hashlib.scrypt(str(spec.seed).encode(), salt=salt, n=2**14, r=8, p=1, dklen=16).hex()
