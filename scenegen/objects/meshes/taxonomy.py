"""What ShapeNet says about itself in files beside the models: names of classes, official splits."""

import csv
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from scenegen.objects.meshes.errors import MeshFolderError

BUILT_IN = {
    "02773838": "bag",
    "02876657": "bottle",
    "02880940": "bowl",
    "02946921": "can",
    "02954340": "cap",
    "03001627": "chair",
    "03636649": "lamp",
    "03797390": "mug",
    "04379243": "table",
}
SPLITS = {"train": "train", "val": "val", "validation": "val", "test": "test"}
_COLUMNS = ("synsetId", "modelId", "split")


def is_synset(name: object) -> bool:
    """Whether a name is a WordNet offset as ShapeNet writes them: eight digits."""
    return isinstance(name, str) and len(name) == 8 and name.isascii() and name.isdigit()


def synset_names(root: Path) -> dict[str, tuple[str, ...]]:
    """Return each synset's names, the one to show first.

    They come from `taxonomy.json`, a flat list or a tree, if there is one; the names in `BUILT_IN`
    go before those.

    Raises:
        MeshFolderError: where the file is there but is no such list.
    """
    names: dict[str, tuple[str, ...]] = {synset: (name,) for synset, name in BUILT_IN.items()}
    path = root / "taxonomy.json"
    try:
        tree = json.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        return names
    except (OSError, ValueError, RecursionError) as error:
        raise MeshFolderError(
            f"{path}: cannot be read as JSON ({error}); mend it or delete it, "
            f"the names of {len(BUILT_IN)} common classes are built in"
        ) from error
    for synset, text in _entries(tree):
        told = [" ".join(part.replace("/", " ").split()) for part in text.split(",")]
        known = names.get(synset, ())
        names[synset] = (*known, *(name for name in told if name and name not in known))
    return names


def _entries(tree: Any) -> Iterator[tuple[str, str]]:
    """Walk lists, children and metadata, however deep, and give (synset, comma-separated names)."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, list):
            waiting.extend(reversed(node))
        elif isinstance(node, dict):
            waiting.extend(part for part in node.values() if isinstance(part, dict | list))
            texts = [node.get(key) for key in ("synsetId", "synset", "id", "name", "label", "text")]
            strings = [text for text in texts if isinstance(text, str)]
            synset = next((text for text in strings if is_synset(text)), None)
            name = next((text for text in strings if not is_synset(text)), None)
            if synset and name:
                yield synset, name


def official_splits(root: Path) -> dict[tuple[str, str], str] | None:
    """Return "train", "val" or "test" by (synset, model id) from `all.csv`; None without one.

    Raises:
        MeshFolderError: where the file lacks a column.
    """
    path = root / "all.csv"
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = csv.DictReader(file)
            columns = rows.fieldnames or ()
            missing = [name for name in _COLUMNS if name not in columns]
            if missing:
                raise MeshFolderError(
                    f"{path}: found the columns {', '.join(columns) or '(none)'}, "
                    f"expected also {', '.join(missing)}; mend it or delete it"
                )
            return {
                (row["synsetId"].zfill(8), row["modelId"]): SPLITS[row["split"].lower()]
                for row in rows
                if row["modelId"] and (row["split"] or "").lower() in SPLITS
            }
    except FileNotFoundError:
        return None
    except (OSError, ValueError, csv.Error) as error:
        if isinstance(error, MeshFolderError):
            raise
        raise MeshFolderError(f"{path}: cannot be read ({error}); mend it or delete it") from error
