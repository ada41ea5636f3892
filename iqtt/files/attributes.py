"""The root attributes of question files of ours, and what their versions say."""

from pathlib import Path

import h5py

from iqtt.files.layout import DIGESTS_SINCE, FORMAT_NAME, FORMAT_VERSION, ROOT_TEXTS
from iqtt.questions.specs import SPLITS, SplitSpec
from scenegen.common.hdf5.attributes import check_attribute, read_texts
from scenegen.common.hdf5.row_file import read_spec


def read_root(file: h5py.File, path: Path) -> tuple[dict[str, str], SplitSpec | None, str | None]:
    """Return the texts, spec and split of a file of ours; nothing for one without `format`.

    Other attributes are not read; released files have none.
    """
    if "format" not in file.attrs:
        return {}, None, None
    texts = read_texts(file, ROOT_TEXTS, path)
    kind = texts["format"]
    check_attribute(path, "format", kind, kind == FORMAT_NAME, repr(FORMAT_NAME))
    spec = read_spec(path, texts, FORMAT_VERSION, SplitSpec.from_json)
    version, split = texts["format_version"], texts.get("split")
    check_attribute(path, "format_version", version, _minor(version).isdecimal(), FORMAT_VERSION)
    check_attribute(path, "split", split, split in SPLITS, f"one of {', '.join(SPLITS)}")
    return texts, spec, split


def has_digests(texts: dict[str, str]) -> bool:
    """Return whether a file of this version has digests of what it holds."""
    return bool(texts) and int(_minor(texts["format_version"])) >= DIGESTS_SINCE


def _minor(version: str) -> str:
    return version.partition(".")[2]
