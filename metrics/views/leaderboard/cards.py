"""Cards of methods: what a leaderboard says of them beside their scores, from a YAML file."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml

from metrics.scoring.records import ScoreFile
from metrics.views.table import Cell
from scenegen.common.errors import SpecError
from scenegen.common.records import from_json

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
    """Return cards by name of the method. Raises SpecError for other content, and OSError."""
    text = Path(path).read_text(encoding="utf-8", errors="replace")
    if len(text) > LARGEST:
        raise SpecError(path, f"{len(text):,} characters", f"at most {LARGEST:,}")
    try:
        if any(isinstance(event, yaml.AliasEvent) for event in yaml.parse(text)):
            raise SpecError(path, "an alias", "YAML without aliases")  # they may unfold without end
        content = json.dumps(yaml.safe_load(text) or {}, default=str)
        return from_json(dict[str, Card], content, str(path))
    except (yaml.YAMLError, RecursionError, TypeError, ValueError) as error:
        if isinstance(error, SpecError):
            raise error.inside(path) from error
        raise SpecError(path, "no YAML that can be read", "cards by name of the method") from error


def card_cells(card: Card, file: ScoreFile) -> Mapping[str, Cell]:
    """Return the cells of a method by their heads."""
    seen = VIEWS_SEEN[file.shown] if file.task == "rooms" else ""
    texts = (card.trained_on, card.told, seen, card.paper, card.code, card.date)
    return {head: _cell(text) for head, text in zip(HEAD, texts, strict=True)}


def _cell(text: str) -> Cell:
    is_link = text.startswith(("https://", "http://"))
    return Cell(text or "-", link=text if is_link else "")
