"""ShapeNetCore, version 1 or 2: where its models are, the names of its classes, its splits.

Models have +y up; those of version 1 face +x, those of version 2 face -z. The layout and the files
`taxonomy.json` and `all.csv` are those of A. Chang et al., "ShapeNet: An Information-Rich 3D Model
Repository", arXiv:1512.03012, and of the SHREC 2016 splits.
"""

import csv
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from scenegen.objects.meshes.errors import MeshFolderError
from scenegen.objects.meshes.listing import (
    ModelFolder,
    existing,
    make_listing,
    object_split,
    subfolders,
)

CLASS_NAMES = {
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
SPLIT_NAMES = {"train": "train", "val": "val", "validation": "val", "test": "test"}
_COLUMNS = ("synsetId", "modelId", "split")
_MODEL_PATHS = {"shapenet-v1": "model.obj", "shapenet-v2": "models/model_normalized.obj"}


def open_shapenet(
    root: str | Path, classes: Sequence[str] | None = None, split: str = "all"
) -> ModelFolder:
    """List ShapeNetCore, of whichever version is there.

    Splits are the official ones if `all.csv` is in the root (models missing from it are in no
    split), else those of `object_split`. Official splits are taken as they are, also where two of
    them share an object.

    Args:
        classes: names such as "mug", or synsets such as "03797390"; None for all that are there.
        split: "all", "train", "val" or "test".

    Raises:
        MeshFolderError: the folder does not exist or is not ShapeNet, a class or split is unknown,
            or no model is left.
    """
    root = existing(root)
    kind = shapenet_version(root)
    if kind is None:
        raise MeshFolderError(
            root,
            "no ShapeNet",
            "<synset>/<id>/model.obj (version 1) or <synset>/<id>/models/model_normalized.obj"
            " (version 2), a synset being 8 digits",
            "name the folder that holds the synsets, or use --objects-root for a plain folder",
        )
    aliases, shown = synset_names(root), {}
    for synset in sorted(name for name in subfolders(root) if _is_synset(name)):
        first = aliases.get(synset, (synset,))[0]
        shown[first if first not in shown else f"{first} {synset}"] = synset
    official = official_splits(root)

    def name_of(asked: str) -> str:
        also = (n for n, synset in shown.items() if asked in (synset, *aliases.get(synset, ())))
        return asked if asked in shown else next(also, asked)

    def models_of(name: str) -> Iterator[tuple[str, Path]]:
        folder = root / shown[name]
        return ((id_, folder / id_ / _MODEL_PATHS[kind]) for id_ in subfolders(folder))

    def split_of(name: str, model_id: str) -> str | None:
        if official is None:
            return object_split(model_id)
        return official.get((shown[name], model_id))

    asked = None if classes is None else [name_of(name) for name in classes]
    return make_listing(
        root, kind, "y", sorted(shown), asked, split, models_of, split_of, official is None
    )


def shapenet_version(root: Path) -> str | None:
    """Return "shapenet-v1" or "shapenet-v2", by the first model found; None if there is none."""
    for synset in sorted(subfolders(root)):
        if _is_synset(synset):
            for model_id in sorted(subfolders(root / synset)):
                for kind, path in _MODEL_PATHS.items():
                    if (root / synset / model_id / path).is_file():
                        return kind
    return None


def _is_synset(name: object) -> bool:
    """Return whether a name is a WordNet offset as ShapeNet writes them: eight digits."""
    return isinstance(name, str) and len(name) == 8 and name.isascii() and name.isdigit()


def synset_names(root: Path) -> dict[str, tuple[str, ...]]:
    """Return each synset's names, the one to be shown first.

    They come from `CLASS_NAMES` and then from `taxonomy.json`, a flat list or a tree, if there is
    one. Raises MeshFolderError where that file is not JSON.
    """
    names: dict[str, tuple[str, ...]] = {synset: (name,) for synset, name in CLASS_NAMES.items()}
    path = root / "taxonomy.json"
    try:
        tree = json.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        return names
    except (OSError, ValueError, RecursionError) as error:
        hint = f"mend it or delete it, as {len(CLASS_NAMES)} common class names are built in"
        raise MeshFolderError(path, error, "JSON", hint) from error
    for synset, text in _taxonomy_entries(tree):
        told = [" ".join(part.replace("/", " ").split()) for part in text.split(",")]
        known = names.get(synset, ())
        names[synset] = (*known, *(name for name in told if name and name not in known))
    return names


def _taxonomy_entries(tree: Any) -> Iterator[tuple[str, str]]:
    """Walk lists and objects of any depth and yield (synset, comma-separated names)."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, list):
            waiting.extend(reversed(node))
        elif isinstance(node, dict):
            waiting.extend(part for part in node.values() if isinstance(part, dict | list))
            texts = [node.get(key) for key in ("synsetId", "synset", "id", "name", "label", "text")]
            strings = [text for text in texts if isinstance(text, str)]
            synset = next((text for text in strings if _is_synset(text)), None)
            name = next((text for text in strings if not _is_synset(text)), None)
            if synset and name:
                yield synset, name


def official_splits(root: Path) -> dict[tuple[str, str], str] | None:
    """Return "train", "val" or "test" by (synset, model id) from `all.csv`; None without one.

    Raises MeshFolderError where the file cannot be read or lacks a column.
    """
    path, hint = root / "all.csv", "mend it or delete it"
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = csv.DictReader(file)
            columns = rows.fieldnames or ()
            if not set(_COLUMNS) <= set(columns):
                found = f"the columns {', '.join(columns) or '(none)'}"
                raise MeshFolderError(path, found, ", ".join(_COLUMNS), hint)
            return {
                (row["synsetId"].zfill(8), row["modelId"]): SPLIT_NAMES[row["split"].lower()]
                for row in rows
                if row["modelId"] and (row["split"] or "").lower() in SPLIT_NAMES
            }
    except FileNotFoundError:
        return None
    except MeshFolderError:
        raise
    except (OSError, ValueError, csv.Error) as error:
        raise MeshFolderError(path, error, "a table with commas", hint) from error
