"""Cards of methods: what a leaderboard says of them beside their scores, from a YAML file."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from yaml.constructor import SafeConstructor

from metrics.scoring.records import ScoreFile
from metrics.views.table import Cell
from scenegen.common.errors import SpecError
from scenegen.common.names import did_you_mean
from scenegen.common.records import from_json

DEEPEST = 3  # a table of cards, a card, and one for the message that a field is no text
LARGEST = 1_000_000  # characters of a file of cards
HEAD = ("trained on", "told", "views seen", "paper", "code", "date")
VIEWS_SEEN = {
    "scored_view": "the scored view",
    "first_view": "the first view alone",
    "no_view": "no view",
}


@dataclass(frozen=True)
class Card:
    """What is known of a method; texts may be empty.

    Attributes:
        trained_on: data, and what of it.
        supervised: whether true depth, or right answers, were used in training.
        told: what the method is told when it predicts, beside the image.
        paper, code: where they are; addresses become links on pages.
        date: when it was submitted.
    """

    trained_on: str = ""
    supervised: bool = False
    told: str = ""
    paper: str = ""
    code: str = ""
    date: str = ""


def read_cards(path: str | Path) -> dict[str, Card]:
    """Return cards by name of the method. Raises SpecError for other content, and OSError.

    Names and texts are taken as they are written, whatever else YAML makes of 1e3, NO or a date.
    """
    text = Path(path).read_text(encoding="utf-8", errors="replace")
    if len(text) > LARGEST:
        raise SpecError(path, f"{len(text):,} characters", f"at most {LARGEST:,}")
    try:
        depth = 0
        for event in yaml.parse(text):
            if isinstance(event, yaml.AliasEvent):  # they may unfold without end
                raise SpecError(path, "an alias", "YAML without aliases")
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > DEEPEST:  # the time to read them grows with the square
                raise SpecError(path, "lists in lists", "cards by name of the method")
        root = yaml.compose(text, yaml.SafeLoader)
        content = {} if root is None else _as_written(root, path)
        return from_json(dict[str, Card], json.dumps(content), str(path))
    except (yaml.YAMLError, RecursionError, TypeError, ValueError) as error:
        if isinstance(error, SpecError):
            raise error.inside(path) from error
        raise SpecError(path, "no YAML that can be read", "cards by name of the method") from error


def _as_written(node: yaml.Node, path: str | Path) -> Any:
    """Return a node of YAML as texts, lists and dicts; of `supervised` the truth value."""
    if isinstance(node, yaml.SequenceNode):
        return [_as_written(item, path) for item in node.value]
    if not isinstance(node, yaml.MappingNode):
        return node.value
    content: dict[Any, Any] = {}
    for key, value in node.value:
        name = _as_written(key, path)
        if not isinstance(name, str) or name in content:
            raise SpecError(
                f"{path}: line {key.start_mark.line + 1}", f"{name!r:.60}", "a new name"
            )
        content[name] = _as_written(value, path)
        if name == "supervised" and value.tag == "tag:yaml.org,2002:bool":
            content[name] = SafeConstructor.bool_values[value.value.lower()]
    return content


def unmatched(cards: Mapping[str, Card], files: Sequence[ScoreFile]) -> list[str]:
    """Return a sentence for each card whose method none of the files has."""
    methods = sorted({file.method for file in files})
    return [
        "; ".join(filter(None, (f"no score file has the method {name!r:.80}", hint)))
        for name in cards
        if name not in methods
        for hint in [did_you_mean(name, methods)]
    ]


def card_cells(card: Card, file: ScoreFile) -> Mapping[str, Cell]:
    """Return the cells of a method by their heads."""
    seen = VIEWS_SEEN[file.shown] if file.task == "rooms" else ""
    texts = (card.trained_on, card.told, seen, card.paper, card.code, card.date)
    return {head: _cell(text) for head, text in zip(HEAD, texts, strict=True)}


def _cell(text: str) -> Cell:
    is_link = text.startswith(("https://", "http://"))
    return Cell(text or "-", link=text if is_link else "")
