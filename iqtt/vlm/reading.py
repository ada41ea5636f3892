"""Which answer a model's text names: one function for every harness.

1. `replies` takes away what is no reply: thoughts, other turns, marks of chat templates.
2. Tags, boxes and JSON that declare their content to be the answer decide.
3. Else every letter that is named has a standing by the words around it (`mentions`).
4. The strongest standing decides. Where that names several letters, the text has no answer.

A text that a careful person would call unclear stays unread.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from iqtt.vlm.mentions import mentions
from iqtt.vlm.replies import declared_parts, plain_characters, replies
from iqtt.vlm.words import FILLER, REFUSAL

Outcome = Literal["answered", "unparsed", "refused", "cut off"]
LETTERS = "ABCDEFGHIJ"
# What servers and harnesses call the end of a reply, where it is no answer like others.
ENDINGS: Mapping[str, Outcome] = {
    **dict.fromkeys(("length", "max_tokens", "model_length", "max_output_tokens"), "cut off"),
    **dict.fromkeys(("content_filter", "refusal", "safety", "prohibited_content"), "refused"),
}
QUOTED, QUOTE = 3, 80  # unread replies that are quoted, and their characters


@dataclass(frozen=True)
class Reading:
    """What a text answers.

    Attributes:
        answer: index of the letter, 0 for A; None where there is none.
        outcome: "answered"; "unparsed" where the text names no letter, a letter that is not
            offered, or several; "refused" where it says that the model does not answer; "cut off"
            where the reply was ended by a limit of tokens, with its answer if it declares one.
    """

    answer: int | None
    outcome: Outcome


def read_answer(text: str, answers: int = 3, *, cut_off: bool = False) -> Reading:
    """Return which of A, B, C ... a model's text gives as its answer.

    What is declared to be the answer wins over what is said of a picture, wherever it stands; the
    last declaration counts. What is denied, compared or asked is no answer. Thoughts do not count.

    Args:
        answers: how many letters are offered, 1 to 10.
        cut_off: whether the text ended because of a limit of tokens. Only a declared answer, or a
            letter alone, counts then.
    """
    text = plain_characters(text)
    letters: set[str] = set()
    for reply in replies(text):
        letters = _letters(reply, LETTERS[:answers], cut_off)
        if letters:
            break
    index = LETTERS.find(next(iter(letters))) if len(letters) == 1 else -1
    answer = index if 0 <= index < answers else None
    if cut_off:
        return Reading(answer, "cut off")
    if answer is not None:
        return Reading(answer, "answered")
    refused = not letters and any(map(REFUSAL.search, replies(text)))
    return Reading(None, "refused" if refused else "unparsed")


def read_reply(text: str, answers: int, outcome: Outcome | None) -> Reading:
    """Return how a reply is read whose end a server or a harness tells, as ENDINGS has it."""
    if outcome == "refused":
        return Reading(None, "refused")
    return read_answer(text, answers, cut_off=outcome == "cut off")


def unread_note(unread: Sequence[tuple[str, str]], rows: int) -> str:
    """Return the share of rows without a letter, and the first three of their texts.

    Args:
        unread: name of the row and text of the model, of each row without a letter.
        rows: how many replies there are.
    """
    if not unread:
        return f"all {rows} replies name a letter"
    quoted = [f"{name}: {_quoted(text)}" for name, text in unread[:QUOTED]]
    share = f"{len(unread)} of {rows} replies name no letter ({len(unread) / rows:.0%})"
    return f"{share} and count as no response, such as {'; '.join(quoted)}"


def _quoted(text: str) -> str:
    """Return the end of a text, where an answer would stand, as one line that prints."""
    line = " ".join(text.split()).encode(errors="replace").decode()
    line = "".join(c if c.isprintable() else "?" for c in line)
    return json.dumps(line if len(line) <= QUOTE else f"...{line[3 - QUOTE :]}", ensure_ascii=False)


def _letters(text: str, offered: str, cut_off: bool) -> set[str]:
    """Return the letters that a reply answers with: one, several where it is unclear, or none."""
    for part in reversed(declared_parts(text)):
        letters = _letters(part, offered, False)
        if letters:
            return letters
    return _letters_in_prose(text, offered, cut_off)


def _letters_in_prose(text: str, offered: str, cut_off: bool) -> set[str]:
    found = mentions(text, offered)
    declared = [i for i, mention in enumerate(found) if mention.standing == "declared"]
    if declared:
        last, later = found[declared[-1]], found[declared[-1] + 1 :]
        taken_back = any(m.standing == "denied" and m.letters == last.letters for m in later)
        return set(LETTERS) if taken_back else set(last.letters)
    denied = {letter for m in found if m.standing == "denied" for letter in m.letters}
    labels = {letter for m in found if m.labelled for letter in m.letters}
    if cut_off and len(FILLER.sub("", text)) != 1:
        return set()
    for standing in ("alone", "believed", "said", "label"):
        letters = {letter for m in found if m.standing == standing for letter in m.letters}
        letters = letters if len(letters) > 1 else letters - denied
        if letters and (standing != "label" or len(labels) == 1):
            return letters
    return set()
