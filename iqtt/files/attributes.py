"""The root attributes of question files of ours, and what their versions say."""

from dataclasses import replace
from pathlib import Path

import h5py

from iqtt.files.layout import FORMAT_NAME, FORMAT_VERSION, OLD_VERSION, ROOT_TEXTS
from iqtt.questions.specs import SPLITS, SplitSpec
from scenegen.files.attributes import check_attribute, read_texts
from scenegen.files.row_file import read_spec


def read_root(file: h5py.File, path: Path) -> tuple[dict[str, str], SplitSpec | None, str | None]:
    """Return the texts, spec and split of a file of ours; nothing for one without `format`.

    Other attributes are not read; released files have none.
    """
    if "format" not in file.attrs:
        return {}, None, None
    texts = read_texts(file, ROOT_TEXTS, path)
    kind = texts["format"]
    check_attribute(path, "format", kind, kind == FORMAT_NAME, repr(FORMAT_NAME))
    old = str(texts.get("format_version")).startswith("1.")
    spec = read_spec(path, texts, OLD_VERSION if old else FORMAT_VERSION, SplitSpec.from_json)
    if old:  # which knew no rule on lines of sight
        spec = replace(spec, min_sight_angle_degrees=0.0)
    version, split = texts["format_version"], texts.get("split")
    minor = version.partition(".")[2]
    check_attribute(path, "format_version", version, minor.isdecimal(), FORMAT_VERSION)
    check_attribute(path, "split", split, split in SPLITS, f"one of {', '.join(SPLITS)}")
    return texts, spec, split


def version_of(texts: dict[str, str]) -> tuple[int, int]:
    """Return the version of a file from its root's texts; (0, 0) of a released file."""
    major, _, minor = texts.get("format_version", "0.0").partition(".")
    return int(major), int(minor)
