"""The submission format as tables, which the reader, the writers and `describe_format` share."""

import unicodedata
from dataclasses import dataclass
from typing import Any, get_args

from metrics.measures.answers import CANDIDATES
from metrics.measures.depth import Alignment
from scenegen.files.schema import Column

FORMAT_NAME = "pix2shape-bench/predictions"
FORMAT_VERSION = "1.1"
TASKS = ("rooms", "iqtt")
TWO_OR_THREE = " or ".join(map(str, CANDIDATES))  # the size of an axis with one entry an answer
ALIGNMENTS: tuple[str, ...] = get_args(Alignment)
MOST_ROWS = 10_000_000
LONGEST_NAME = 200  # characters of method and run, which tables and file names repeat
LONGEST_TEXT = 10_000
DATA_FORMATS = {"pix2shape-bench/rooms": "rooms", "pix2shape-bench/iqtt": "questions"}
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


@dataclass(frozen=True)
class Dataset:
    """A dataset with one entry for each of the M rows.

    Attributes:
        shape: of an entry; H and W are the height and width of the truth's images, `TWO_OR_THREE`
            how many answers its questions offer.
        kinds: NumPy kinds that a reader accepts: "iu" or "f".
        dtype: the type that our writer stores.
    """

    task: str
    name: str
    shape: tuple[str | int, ...]
    kinds: str
    dtype: str
    unit: str
    frame: str
    meaning: str
    required: bool = True

    @property
    def kind(self) -> str:
        """The kinds in words."""
        return "integers" if self.kinds == "iu" else "floats"

    @property
    def shown_shape(self) -> str:
        """The whole shape, such as (M, H, W, 3)."""
        return f"({', '.join(['M', *map(str, self.shape)])}{'' if self.shape else ','})"

    def column(self, height: int = 0, width: int = 0) -> Column:
        """Return the column that our writer stores for images of this size."""
        sizes: dict[str | int, int] = {"H": height, "W": width}
        shape = tuple(sizes[s] if isinstance(s, str) else s for s in self.shape)
        more = {"shape": self.shown_shape}
        return Column(
            self.name, shape, self.dtype, self.unit, self.frame, self.meaning,
            own_chunk=len(shape) > 1, more=more,
        )  # fmt: skip

    @property
    def attributes(self) -> dict[str, Any]:
        """The HDF5 attributes that our writer gives it."""
        return {
            "unit": self.unit,
            "frame": self.frame,
            "shape": self.shown_shape,
            "meaning": self.meaning,
        }


ATTRIBUTES = (
    Attribute("format", "what the file is", choices=(FORMAT_NAME,)),
    Attribute("format_version", f"version of this layout; 1.x is read ({FORMAT_VERSION} now)"),
    Attribute("task", "what is predicted", choices=TASKS),
    Attribute("method", "name of the method; tables show it", longest=LONGEST_NAME),
    Attribute("run", "which training run, such as its seed: runs of one method are averaged",
              required=False, may_be_empty=True, longest=LONGEST_NAME),
    Attribute("truth_fingerprint", "the attribute `fingerprint` of the truth file; empty if that"
              " has none, as the released 3D-IQTT", may_be_empty=True),
    Attribute("truth_path", "where the truth lay; looked up from the submission's folder, then the"
              " working directory, unless --truth is given; scores are not comparable without that",
              required=False, may_be_empty=True),
    Attribute("alignment", "what the method cannot know, and the truth may decide for it",
              required=False, tasks=("rooms",), choices=ALIGNMENTS),
    Attribute("writer", "the program that wrote the file", required=False, may_be_empty=True),
    Attribute("notes", "anything else", required=False, may_be_empty=True),
)  # fmt: skip
DATASETS = (
    Dataset("rooms", "row", (), "iu", "int64", "1", "-", "row of the truth file; in any order"),
    Dataset("rooms", "depth", ("H", "W"), "f", "float32", "scene unit", "camera",
            "planar depth, -z in the camera frame (not the distance along the ray), of the ray"
            " through the pixel's centre; finite in float32 wherever the truth shows a surface, and"
            " above 0 to lie in front of the camera"),
    Dataset("rooms", "normal", ("H", "W", 3), "f", "float32", "1", "camera",
            "surface normal, x right, y up, z towards the viewer; faces the viewer; of any length"
            " but 0 wherever the truth has a normal", required=False),
    Dataset("iqtt", "question", (), "iu", "int64", "1", "-", "index in the test file; any order"),
    Dataset("iqtt", "answer", (), "iu", "int8", "1", "-",
            "which of the answers shows the reference, from 0; -1 abstains, which counts as wrong",
            required=False),
    Dataset("iqtt", "scores", (TWO_OR_THREE,), "f", "float64", "1", "-",
            "one for each answer; the highest wins, a tie for it counts as an abstention; if"
            " `answer` is there too, both must say the same", required=False),
)  # fmt: skip
ID_NAMES = {"rooms": "row", "iqtt": "question"}


def datasets(task: str) -> tuple[Dataset, ...]:
    """Return the datasets of a task's submissions."""
    return tuple(dataset for dataset in DATASETS if dataset.task == task)


def attributes(task: str) -> tuple[Attribute, ...]:
    """Return the root attributes of a task's submissions."""
    return tuple(attribute for attribute in ATTRIBUTES if task in attribute.tasks)


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
        lines += [_describe_dataset(dataset) for dataset in datasets(task)]
    lines += [
        "",
        "Rows may come in any order, each once; all rows of the truth are scored, so a missing one"
        " is an error.",
        "A submission is one file: links and data outside it are refused, and so are datasets of"
        " which a part was never written.",
        "Datasets are compressed by gzip or lzf, with or without shuffle and fletcher32, or not at"
        " all.",
        "iqtt takes JSON as well: a list of answers; an object from index to answer; or",
        '  {"method": "...", "run": "...", "answers": a list or an object}',
        "  JSON names no truth: give it with --truth.",
        "",
        "Depth is planar. If a network gives distance along the ray, divide it by the length of"
        " the ray's direction d,",
        "  d = ((c + 0.5 - W/2) s, (H/2 - r - 0.5) s, -1), s = 2 tan(fov_y / 2) / H, in row r,"
        " column c.",
        "metrics.prediction_writer writes such files and checks every row as it comes:",
        '  with RoomPredictionWriter("predictions.h5", "rooms.h5", method="mine") as out:',
        "      out.add(row, depth, normal)",
    ]
    return "\n".join(lines)


def _describe_attribute(attribute: Attribute) -> str:
    notes = "" if attribute.required else "optional; "
    only = f"{attribute.tasks[0]} only; " if len(attribute.tasks) == 1 else ""
    choices = f": {', '.join(attribute.choices)}" if attribute.choices else ""
    return f"  {attribute.name:<18} {notes}{only}{attribute.meaning}{choices}"


def _describe_dataset(dataset: Dataset) -> str:
    notes = "" if dataset.required else "optional; "
    if dataset.name in ("answer", "scores"):
        notes = "this, or both; "
    unit = "" if dataset.unit == "1" else f", {dataset.unit}s"
    frame = "" if dataset.frame == "-" else f", {dataset.frame} frame"
    what = f"{dataset.shown_shape} {dataset.kind}{unit}{frame}"
    return f"  {dataset.name:<9} {what}\n            {notes}{dataset.meaning}"
