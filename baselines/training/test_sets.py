"""Test sets are not trained on, unless somebody means it."""

import itertools
import json
import shlex
from typing import Any

from metrics.scoring.known_tests import KNOWN_TESTS, KnownTest, known_test
from scenegen.common.errors import SpecError
from scenegen.files.sets.shards import OpenFile

SAME = ("seed", "source", "shapes", "object_split")  # settings that make the same scenes


def refuse_test_set(opened: OpenFile) -> None:
    """Refuse a file to learn from that is a named test set, or rooms of its seed and objects.

    Of questions the pictures alone tell the set, as files without answers have no truth.

    Raises SpecError. Other files pass.
    """
    file = opened.file
    texts = {name: str(value) for name, value in file.attrs.items()}
    pictures = str(file["questions"].attrs.get("sha256", "")) if "questions" in file else ""
    test = known_test(texts.get("truth_digest", ""))
    test = test or next((t for t in KNOWN_TESTS if pictures and t.pictures == pictures), None)
    refuse_request(opened.path, texts.get("spec", ""), test)


def refuse_request(where: object, spec: str, test: KnownTest | None = None) -> None:
    """Raise SpecError for a named test set, or a request for rooms of its seed and objects."""
    test = test or _like(spec)
    if test:
        hint = "take another --seed for training, or say --allow-test-set"
        found = f"the seed and the objects of the test set {test.name}"
        raise SpecError(where, found, "training data", hint)


def _like(text: str) -> KnownTest | None:
    """Return the test set of rooms that has the seed and the objects of a specification."""
    try:
        spec: Any = json.loads(text)
        found = [spec[name] for name in SAME]
    except (ValueError, TypeError, KeyError):
        return None
    return next((test for test in KNOWN_TESTS if _settings(test) == found), None)


def _settings(test: KnownTest) -> list[Any]:
    """Return `SAME` of the scenes of a set of rooms; nothing where the seed is the default."""
    from scenegen.description.presets import preset_spec

    given = dict(itertools.pairwise(shlex.split(test.command)))
    if test.task != "rooms" or "--seed" not in given:
        return []
    split = {"object_split": given["--object-split"]} if "--object-split" in given else {}
    spec = preset_spec(given.get("--preset", "shapes"), seed=int(given["--seed"]), **split)
    return [json.loads(spec.to_json())[name] for name in SAME]
