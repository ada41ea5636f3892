"""Which answer a model's text names: one function for every harness."""

import json
import re
from dataclasses import dataclass
from typing import Literal

Outcome = Literal["answered", "unparsed", "refused"]
LETTERS = "ABCDEFGHIJ"
_THOUGHT = re.compile(r"<(think|thinking|reasoning)>.*?</\1>", re.DOTALL | re.IGNORECASE)
_UNFINISHED = re.compile(r"<(think|thinking|reasoning)>.*", re.DOTALL | re.IGNORECASE)
_BOXED = re.compile(r"\\boxed\s*\{\s*((?:[^{}]|\{[^{}]*\})*)\}")
_LATEX = re.compile(r"\\(?:text|textbf|mathrm|mathbf|rm)\s*\{([^{}]*)\}")
_NOUN = (
    r"(?:the\s+)?(?:picture|pictures|image|option|choice|answer|figure|candidate|letter|shape)s?"
)
_LETTER = r"[\(\[\"'“‘]*([A-J])(?![A-Za-z'’])"
# A letter that is said to be the answer. The article "a" is lower case, so letters are upper case.
_STATED = re.compile(
    r"(?:"
    r"(?i:\banswer\s*(?:is|was|would\s+be|should\s+be|must\s+be|:|=|-|→|->)+)"
    r"|(?i:\bfinal\s+answer\s*(?:is|:|=|-)*)"
    r"|(?i:\b(?:choose|pick|select|chose|picked|selected|choosing|go\s+with|go\s+for)\b)"
    r"|(?i:\b(?:correct|right|matching|best|same)\s+(?:one|answer|option|choice|picture|image|"
    r"match|shape|figure)\s*(?:is|would\s+be|must\s+be|:|=)+)"
    r"|(?i:\bit(?:'s|\s+is|\s+must\s+be)\b)"
    r")\s*(?i:" + _NOUN + r"\s*)?:?\s*" + _LETTER
)
# "Picture B shows the same shape", "B is the correct answer", "B matches the reference".
_SAID_OF = re.compile(
    r"(?:\b(?i:" + _NOUN + r")\s+)?(?<![A-Za-z])" + _LETTER + r"[\)\]\"'”’]*\s+(?i:"
    r"(?:is|shows|would\s+be|must\s+be|depicts)\s+(?:\w+\s+){0,4}?(?:answer|correct|right|match|same)"
    r"|matches|is\s+the\s+one)"
)
_NEGATED = re.compile(r"(?i)\b(?:not|isn't|cannot|neither|never|n't)\b")
_NAMED = re.compile(r"\b(?i:" + _NOUN + r")\s*:?\s*" + _LETTER)
_ALONE = re.compile(r"^\W*(?:(?i:" + _NOUN + r")\W*)?([A-Ja-j])\W*$")
_LEADING = re.compile(r"^[\s\(\[\"'*_#>]*([A-J])\s*[\)\].:,\-–—*]+(?:\s|$)")
_OTHERS = re.compile(
    r"^[\)\]\"'”’]*\s*(?:,|/|&|\||(?i:or|and|nor|vs\.?|both|as\s+well\s+as))\s*(?i:"
    + _NOUN
    + r"\s*)?[\(\[\"']*([A-J])(?![A-Za-z'’])"
)
_BEFORE = re.compile(r"([A-J])[\)\]]?\s*(?:,|/|&|or|and)\s*(?i:" + _NOUN + r"\s*)?[\(\[]?$")
_REFUSAL = re.compile(
    r"(?i)\b(?:i\s*(?:'|’)?\s*(?:m|am)\s+(?:sorry|unable|not\s+able)|i\s+(?:can\s*not|can(?:'|’)t"
    r"|won(?:'|’)t|refuse|decline)|unable\s+to\s+(?:see|view|determine|help|answer|process)"
    r"|no\s+image\s+(?:was|is|has)|as\s+an?\s+(?:ai|language)\b)"
)


@dataclass(frozen=True)
class Reading:
    """What a text answers.

    Attributes:
        answer: index of the letter, 0 for A; None unless `outcome` is "answered".
        outcome: "unparsed" where the text names no letter, a letter that is not offered, or
            several of them; "refused" where it says that the model does not answer.
    """

    answer: int | None
    outcome: Outcome


def read_answer(text: str, answers: int = 3) -> Reading:
    """Return which of A, B, C ... a model's text gives as its answer.

    Thoughts between `<think>` tags do not count. The last plain statement decides: a LaTeX box,
    then "the answer is B", then a text, a first line or a last line that is a letter alone, then
    the only letter that is named at all. A statement of two letters is no answer.

    Args:
        answers: how many letters are offered, 1 to 10.
    """
    text = _UNFINISHED.sub("", _THOUGHT.sub("", text)).strip()
    for read in (_of_json, _of_box, _of_short_text, _of_statements, _of_lines, _of_names):
        letters = read(text)
        if letters:
            break
    else:
        return Reading(None, "refused" if _REFUSAL.search(text) else "unparsed")
    index = LETTERS.find(next(iter(letters)).upper()) if len(letters) == 1 else -1
    return Reading(index, "answered") if 0 <= index < answers else Reading(None, "unparsed")


def _of_json(text: str) -> set[str]:
    bare = re.sub(r"^```(?:json)?|```$", "", text).strip()
    if not bare.startswith("{"):
        return set()
    try:
        value = json.loads(bare)
    except ValueError:
        return set()
    said = next((value[key] for key in ("answer", "choice", "final_answer") if key in value), None)
    return _of_short_text(said) if isinstance(said, str) else set()


def _of_box(text: str) -> set[str]:
    boxes = _BOXED.findall(text)
    return _in_short(_LATEX.sub(r"\1", boxes[-1])) if boxes else set()


def _of_short_text(text: str) -> set[str]:
    """Return the letters of a text that is little more than a letter."""
    lines = [line for line in text.splitlines() if line.strip()]
    return _in_short(lines[0]) if len(lines) == 1 else set()


def _in_short(line: str) -> set[str]:
    line = re.sub(r"[*_`$]", "", line).strip()
    alone = _ALONE.match(line)
    if alone:
        return {alone[1].upper()}
    # "A or B", "A, C", "(A) and (B)": several letters and nothing else.
    words = re.findall(r"[A-Za-z]+", line)
    letters = {word for word in words if len(word) == 1 and word in LETTERS}
    rest = {word.lower() for word in words} - {letter.lower() for letter in letters}
    joining = {"or", "and", "either", "both", "picture", "pictures", "image", "images"}
    return letters if len(letters) > 1 and rest <= joining else set()


def _of_statements(text: str) -> set[str]:
    """Return the letters of the last statement of an answer."""
    plain = re.sub(r"[*_`$]", "", _LATEX.sub(r"\1", text))
    statements = [(m.start(1), m) for m in _STATED.finditer(plain)]
    statements += [(m.start(1), m) for m in _SAID_OF.finditer(plain) if not _negated(m[0])]
    if not statements:
        return set()
    match = max(statements, key=lambda pair: pair[0])[1]
    letters, end = {match[1]}, match.end(1)
    before = plain[: match.start(1)]
    joined = re.search(
        r"([A-J])[\)\]]?\s*(?:,|/|&|or|and)\s*(?i:" + _NOUN + r"\s*)?[\(\[]?$", before
    )
    letters |= {joined[1]} if joined else set()
    while other := _OTHERS.match(plain[end:]):
        letters.add(other[1])
        end += other.end(1)
    return letters


def _negated(sentence: str) -> bool:
    return _NEGATED.search(sentence) is not None


def _of_lines(text: str) -> set[str]:
    """Return the letter of a last line, or of a first line, that begins or ends with it."""
    lines = [re.sub(r"[*_`$]", "", line) for line in text.splitlines() if line.strip()]
    for line in (lines[-1], lines[0]) if lines else ():
        alone = _ALONE.match(line) or _LEADING.match(line)
        if alone:
            return {alone[1].upper()}
    return set()


def _of_names(text: str) -> set[str]:
    """Return all letters that stand after a noun such as "picture"."""
    return set(_NAMED.findall(re.sub(r"[*_`$]", "", text)))
