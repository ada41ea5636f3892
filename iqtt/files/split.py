"""The files of a split: their names, and what they hold."""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

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
from iqtt.questions.specs import SPLITS, QuestionSpec
from iqtt.render import groups
from scenegen.files.row_file import writer_name
from scenegen.files.sets.plan import Mark, Part, Piece, Sheet, whole
from scenegen.layout import TRUTH_DIGEST

ANSWERS = "iqtt-test-answers.h5"
FILES = {
    "train": ("iqtt-train.h5",),
    "val": ("iqtt-val.h5",),
    "test": ("iqtt-test.h5", ANSWERS),
}  # of images, and of what is known of the questions
ALL_FILES = tuple(name for split in SPLITS for name in FILES[split])
# What tells questions apart; the answer is where the kind of distractor is -1.
FINGERPRINTED = (
    *("cubes", "world_from_shape", "light_position", "light_color", "distractor_kind"),
    *("scene", "in_play"),
)  # of those there


def split_files(
    spec: QuestionSpec,
    renderer: Mapping[str, str],
    command: str = "",
    secret: bool = False,
    folder: str = "",
) -> list[Piece]:
    """Return the files of a split, and what they hold.

    Seed and command would reveal the test answers. So only the file of the test answers has them,
    and with `secret` it has no seed either.

    Args:
        renderer: Mitsuba's variant, and the versions that `rendering.backend.versions` gives.
        command: that made the split.
        folder: of all files; empty for none.
    """
    public = root_attributes(spec.public(), renderer, "")
    private = root_attributes(spec.public() if secret else spec, renderer, command)
    return [
        whole(
            {
                f"{folder}/{name}".lstrip("/"): {
                    **(private if name == ANSWERS else public),
                    "split": split,
                }
                for name in names
            },
            [
                split_part(spec, split, part, count, len(names) - 1, folder)
                for part, (_, count) in groups(spec, split).items()
            ],
        )
        for split, names in FILES.items()
    ]


def split_request(spec: QuestionSpec, renderer: Mapping[str, str], secret: bool) -> dict[str, Any]:
    """Return what the bytes of the files of a split depend on, as anybody may read it."""
    public = spec.public().to_json()
    # This tells two seeds apart. It does not help to find a seed: to try one takes longer here than
    # to make a question from it.
    check = hashlib.scrypt(
        str(spec.seed).encode(), salt=public.encode(), n=2**14, r=8, p=1, dklen=16
    )
    return {
        **json.loads(public), "kind": FORMAT_NAME, "format_version": FORMAT_VERSION,
        "writer": writer_name(), "secret-seed": "yes" if secret else "no",
        "seed-check": check.hex(), **renderer,
    }  # fmt: skip


def split_part(
    spec: QuestionSpec, split: str, name: str, count: int, truth: int, folder: str = ""
) -> Part:
    """Return a part of a split: images in the first of its files, the rest in file `truth`."""
    with_answers = name != "unlabeled"
    sheets = [
        Sheet(question_columns(spec), 0, name),
        Sheet(truth_columns(spec), truth, f"truth/{name}".rstrip("/"), truth_attributes(spec)),
        *([Sheet([answer_column()], truth, name)] if with_answers else []),
    ]
    known = {column.name for sheet in sheets for column in sheet.columns}
    request = f"{spec.public().to_json()} {split} {name}"
    told = [column for column in FINGERPRINTED if column in known]
    marks = [Mark(named("fingerprint", name), told, range(truth + 1), request)]
    if with_answers:
        scored = [column for column in SCORED if column in known]
        marks.append(Mark(named(TRUTH_DIGEST, name), scored, [truth]))
    return Part(f"{folder}/{split}".lstrip("/"), name, count, sheets, marks)
