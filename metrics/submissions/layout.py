"""The submission format as tables, which the reader, the writers and `describe_format` share."""

import unicodedata
from dataclasses import dataclass
from typing import Any, Literal, get_args

from metrics.measured.layout import FORMAT_NAME as MEASURED
from metrics.measures.answers import CANDIDATES
from metrics.submissions.rules import OUTCOMES, RULES, kind_text, shape_text
from scenegen.files.schema import Column

FORMAT_NAME = "pix2shape-bench/predictions"
FORMAT_VERSION = "1.0"
TASKS = ("rooms", "iqtt", "measured")  # measured: depth on truth that others measured
Shown = Literal["scored_view", "first_view", "no_view"]
# Kinds of geometry: the data set of each, and what a method of it may not know. The first is meant
# where a submission does not say.
KINDS: dict[str, tuple[str, ...]] = {
    "depth": ("none", "median_scale", "scale", "scale_shift"),
    "disparity": ("scale_shift",),
    "points": ("none", "scale", "scale_shift"),
    "layers": ("none", "scale", "scale_shift"),
}
ALIGNMENTS = KINDS["depth"]
LONGEST_NAME = 200  # characters of method and run, which tables and file names repeat
LONGEST_TEXT = 10_000
DATA_FORMATS = {"pix2shape-bench/rooms": "rooms", "pix2shape-bench/iqtt": "questions",
                MEASURED: "measured truth"}  # fmt: skip
_DIRECTION_CONTROLS = frozenset("\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


@dataclass(frozen=True)
class Attribute:
    """A root attribute, which is a text, and the tasks whose submissions may have it."""

    name: str
    meaning: str
    required: bool = True
    may_be_empty: bool = False
    tasks: tuple[str, ...] = TASKS
    choices: tuple[str, ...] = ()
    longest: int = LONGEST_TEXT


ATTRIBUTES = (
    Attribute("format", "what the file is", choices=(FORMAT_NAME,)),
    Attribute("format_version", "version of this layout", choices=(FORMAT_VERSION,)),
    Attribute("task", "what is predicted", choices=TASKS),
    Attribute("method", "name of the method; tables show it", longest=LONGEST_NAME),
    Attribute("run", "name of the training run, such as its seed; runs of one method are averaged",
              required=False, may_be_empty=True, longest=LONGEST_NAME),
    Attribute("truth_fingerprint", "the attribute `fingerprint` of the ground truth file; empty"
              " if the file has none, as the released 3D-IQTT", may_be_empty=True),
    Attribute("truth_path", "path of the ground truth, relative to the submission's folder or the"
              " working directory; used without --truth, and scores are then not comparable",
              required=False, may_be_empty=True),
    Attribute("alignment", "alignment that the predictions need, by prediction type: "
              + "; ".join(f"{kind} {', '.join(kinds)}" for kind, kinds in KINDS.items())
              + "; the first by default",
              required=False, tasks=("rooms", "measured"), choices=ALIGNMENTS),
    Attribute("shown", "input view of a prediction: the scored view, the first view of the scene,"
                       " or no"
              " view; scored_view by default",
              required=False, tasks=("rooms",), choices=get_args(Shown)),
    Attribute("writer", "the program that wrote the file", required=False, may_be_empty=True),
    Attribute("notes", "anything else", required=False, may_be_empty=True),
)  # fmt: skip
COLUMNS = {
    "rooms": (
        Column("row", (), "int64", meaning="row of the ground truth file, in any order"),
        Column("depth", (), "float32", "scene unit", "camera",
               "planar depth, -z in the camera frame (not the distance along the ray), of the ray"
               " through the pixel's centre; positive in front of the camera",
               ("y", "x"), own_chunk=True),
        Column("disparity", (), "float32", "1", "camera",
               "1 / planar depth, up to a scale above 0 and a shift of each image; large for near"
               " surfaces", ("y", "x"), own_chunk=True),
        Column("points", (), "float32", "scene unit", "camera",
               "surface points, x right, y up, z towards the viewer, so that planar depth is -z",
               ("y", "x", "xyz"), own_chunk=True),
        Column("layers", (), "float32", "scene unit", "camera",
               "planar depth of the surfaces along each pixel's ray, in order, also of hidden ones;"
               " NaN behind the last one; layers 1 and 2, 3 and 4, ... are front and back of a"
               " solid, a last one without a partner is background", ("y", "x", "layer"),
               own_chunk=True),
        Column("surface_points", (), "float32", "scene unit", "camera",
               "points evenly by area on the whole surfaces of predicted objects; with layers"
               " alone", ("point", "xyz"), own_chunk=True),
        Column("normal", (), "float32", "1", "camera",
               "surface normal, x right, y up, z towards the viewer; faces the viewer; of any"
               " length but 0", ("y", "x", "xyz"), own_chunk=True),
        Column("confidence", (), "float32", meaning="confidence of the depth of each pixel, larger"
                                                    " for"
               " more certain; only the order within an image counts", axes=("y", "x"),
               own_chunk=True),
        Column("fov_y_degrees", (), "float64", "degree",
               meaning="vertical field of view, if the method estimates the camera"),
    ),
    "iqtt": (
        Column("question", (), "int64", meaning="index in the test file; in any order"),
        Column("answer", (), "int8",
               meaning="index of the selected option, from 0; -1 abstains, which counts as"
               " wrong"),
        Column("scores", (), "float64",
               meaning="one score per option; the highest selects, and a tie counts as an"
               " abstention; `answer`, if present, must agree", axes=("answer",)),
        Column("outcome", (), "int8",
               meaning="outcome of reading the reply of a model: "
               + ", ".join(f"{i} {name}" for i, name in enumerate(OUTCOMES))),
        Column("rotated", (), "int8",
               meaning="the selected option, from 0, if option r is shown first, for r from 0; -1"
               " abstains, -2 not asked; the first column is `answer`", axes=("answer",)),
    ),
}  # fmt: skip
COLUMNS["measured"] = COLUMNS["rooms"]  # in metres; images are padded as in the truth
NEEDED = {"row": "", "question": "", **dict.fromkeys(KINDS, f"one of {', '.join(KINDS)}; "),
          "answer": "this, or both; ", "scores": "this, or both; "}  # fmt: skip
SIZES = {"xyz": (3,), "answer": CANDIDATES}  # of axes that are alike in all files
ID_NAMES = {"rooms": "row", "iqtt": "question", "measured": "row"}


def attributes(task: str) -> tuple[Attribute, ...]:
    """Return the root attributes of a task's submissions; of an unknown task, all."""
    return tuple(a for a in ATTRIBUTES if task not in TASKS or task in a.tasks)


def text_fault(attribute: Attribute, text: Any) -> tuple[str, str] | None:
    """Return what was found and what was expected where a value does not suit an attribute."""
    if not isinstance(text, str):
        return f"{text!r:.40}", "a text"
    if attribute.choices and text not in attribute.choices:
        return f"{text!r:.60}", " or ".join(map(repr, attribute.choices))
    if not text.strip() and not attribute.may_be_empty:
        return "an empty text", "a text"
    if len(text) > attribute.longest:
        return f"{len(text)} characters", f"at most {attribute.longest}"
    allowed = "\n\t" if attribute.name == "notes" else ""
    bad = next((c for c in text if _unprintable(c) and c not in allowed), None)
    return None if bad is None else (f"the character {bad!r}", "a text that can be printed")


def _unprintable(character: str) -> bool:
    """Return whether a character would control a terminal or a page instead of being shown."""
    category = unicodedata.category(character)
    return category in ("Cc", "Cs", "Zl", "Zp") or character in _DIRECTION_CONTROLS


def describe_format() -> str:
    """Return a description of the submission format for a person to read."""
    lines = [
        f"Submission format {FORMAT_VERSION}: one HDF5 file for one run of one method on one test"
        " file.",
        "",
        "Root attributes (texts):",
        *(_describe_attribute(attribute) for attribute in ATTRIBUTES),
    ]
    for task, subject in (("rooms", "images"), ("iqtt", "questions")):
        lines += ["", f"Datasets for task {task!r}, M {subject}:"]
        lines += [_describe_column(column) for column in COLUMNS[task]]
    lines += [
        "",
        "Task 'measured' has the datasets of task 'rooms', in metres. Images have the size to which"
        " the ground truth is padded; values beyond the size of an image are not read.",
        "",
        "Each row of the ground truth must occur exactly once.",
        "A submission is one file: external links, external data and partly written datasets are an"
        " error.",
        "Datasets are compressed by gzip or lzf, with or without shuffle and fletcher32, or not at"
        " all.",
        "Task 'iqtt' takes JSON as well: a list of responses; an object from index to response; or",
        '  {"method": "...", "run": "...", "answers": a list or an object}',
        "  JSON stores no path of the ground truth: use --truth.",
        "",
        "Depth is planar. If a network gives distance along the ray, divide it by the length of"
        " the ray's direction d,",
        "  d = ((c + 0.5 - W/2) s, (H/2 - r - 0.5) s, -1), s = 2 tan(fov_y / 2) / H, in row r,"
        " column c of an H x W image.",
        "metrics.prediction_writer writes such files and checks each row:",
        '  with RoomPredictionWriter("predictions.h5", "rooms.h5", method="mine") as out:',
        "      out.add(row, depth, normal)",
    ]
    return "\n".join(lines)


def _describe_attribute(attribute: Attribute) -> str:
    notes = "" if attribute.required else "optional; "
    only = f"{attribute.tasks[0]} only; " if len(attribute.tasks) == 1 else ""
    listed = attribute.choices and attribute.name != "alignment"  # whose choices go by kind
    choices = f": {', '.join(attribute.choices)}" if listed else ""
    return f"  {attribute.name:<18} {notes}{only}{attribute.meaning}{choices}"


def _describe_column(column: Column) -> str:
    unit = "" if column.unit == "1" else f", {column.unit}s"
    frame = "" if column.frame == "-" else f", {column.frame} frame"
    what = f"{shape_text(column, None, SIZES)} {kind_text(column)}{unit}{frame}"
    notes = NEEDED.get(column.name, "optional; ")
    rules = "; ".join(rule.expected for rule in RULES if column.name in rule.columns)
    indent = "\n            "
    return f"  {column.name:<13} {what}{indent}{notes}{column.meaning}{indent}must be: {rules}"
