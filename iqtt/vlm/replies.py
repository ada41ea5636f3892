"""What a model says to the person: its reply without thoughts and marks of chat templates.

Tags are those of the templates of open models, and of the parsers of vLLM, SGLang, VLMEvalKit and
lmms-eval.
"""

import html
import json
import re
import unicodedata
from collections.abc import Iterator
from typing import Any

_SAME_AS = str.maketrans(
    {
        **dict.fromkeys("“”„«»「」『』〝〟", '"'), **dict.fromkeys("‘’‚`´", "'"),
        **{"【": "[", "】": "]", "。": ". ", "、": ", ", "\x08": "\\b"},
        **{"▁": "_", "Ġ": " ", "Ċ": "\n"},  # of tokens
        **dict.fromkeys("\u200b\u200c\u200d\u200e\u200f\u2060\ufeff\u00ad\ufe0e\ufe0f\u20e3", ""),
        **{chr(base + i): chr(ord("A") + i) for base in (0x1F150, 0x1F170) for i in range(10)},
    }
)  # fmt: skip
_THOUGHT = (
    r"(?:(?!no)[\w:-]*(?:think|thought|reason(?!able)|reflection|scratchpad|monologue)[\w-]*"
    r"|analysis|cot)"
)
_ANSWER = (
    r"(?:\w+:)?(?:(?:final_?|my_?)?answer|final|conclusion|choice|solution|response|result|output|"
    r"verdict|box|ans)"
)


def _tag(name: str) -> str:
    """Return a pattern of opening and closing tags, `<x>`, `[X]`, `◁x▷`, `<|x|>`, ...

    A closing tag is the group "end".
    """
    return (
        rf"(?P<end>[<\[◁]\|?\s*/\s*{name}\s*\|?[>\]▷]|<\|?end_(?:of_)?{name}\|?>|<\|?{name}_end\|?>)"
        rf"|[<\[◁]\|?\s*(?:(?:begin|start)_(?:of_)?)?{name}(?:_start)?(?:\s[^<>\[\]]*)?\|?[>\]▷]"
    )


_THOUGHT_TAG = re.compile(_tag(_THOUGHT), re.IGNORECASE)
_ANSWER_TAG = re.compile(_tag(_ANSWER), re.IGNORECASE)
_CHANNEL = r"(?:<\|channel\|?>|(?<=<\|end\|>)|^)\s*"
# Marks of thoughts that are no tags, and the tag that stands for them.
_CHANNELS = [
    # gpt-oss and Gemma, with their special tokens and without
    (rf"{_CHANNEL}final\b[^<]*(?:<\|constrain\|>[^<]*)?<\|message\|>", "</think>"),
    (r"<\|channel\|?>\s*final\b", "</think>"),
    (
        rf"{_CHANNEL}(?:analysis|commentary)\b[^<]*(?:<\|constrain\|>[^<]*)?<\|message\|>",
        "<think>",
    ),
    (r"<\|channel\|?>\s*\w*", "<think>"),
    (r"^\s*(?:(?:assistant)?\s*analysis(?=[A-Z\s]).*?)?assistant\s*final(?![a-z])", "</think>"),
    (r"^\s*analysis(?=[A-Z])", "<think>"),
    (r"<channel\|>\s*$", ""),
    (r"<channel\|>|<\|inner_suffix\|>|<unused95>", "</think>"),  # Gemma, Apertus, MedGemma
    (r"<\|inner_prefix\|>|<unused94>", "<think>"),
    (r"^\W*here(?:'s| is) my thought process\W", "<think>"),  # Granite
    (r"\n\W*here(?:'s| is) my response\W", "</think>"),
]
_CHANNEL_MARKS = [
    (re.compile(pattern, re.DOTALL if "analysis" in pattern else re.DOTALL | re.IGNORECASE), tag)
    for pattern, tag in _CHANNELS
]
_TURN_ENDS = re.compile(
    r"</s>|<turn\|>|<\|?(?:im_end|im_sep|e(?:os|ot|om|od|oa)(?:_id)?|end|return|call"
    r"|end_?of_?\w+|end_?turn|end_response)\|?>|(?=<\|?im_start\|?>|<\|start_header_id\|>"
    r"|<start_of_turn>|<\|start\|>|<\|turn>|<\|(?:user|human|system|assistant)\|>|\[/?INST\])"
    r"|\n(?=\s*(?:#+ *)?(?:user|human|question) *:)",
    re.IGNORECASE,
)
_ROLE = re.compile(
    r"^\s*(?:(?:<\|?(?:im_start|start_header_id|start_of_turn|start|turn)\|?>\s*(\w+)"
    r"(?:<\|end_header_id\|>)?)|<\|(user|human|system|assistant)\|>|(\[/?INST\])"
    r"|(?:#+ *)?(user|human|question|assistant|model)(?: *:|\s*\n))",
    re.IGNORECASE,
)


def plain_characters(text: str) -> str:
    """Return the text with plain characters, and without long runs of one that is no letter."""
    plain = unicodedata.normalize("NFKC", html.unescape(text)).translate(_SAME_AS)
    return re.sub(r"([\W_])\1{3,}", r"\1\1\1", re.sub(r"[^\S\n]+", " ", plain))


def replies(text: str) -> Iterator[str]:
    """Yield what the model says to the person, turn by turn; the first turn that answers counts."""
    for pattern, tag in _CHANNEL_MARKS:
        text = pattern.sub(tag, text)
    for turn in _TURN_ENDS.split(_without_thoughts(text)):
        role = _ROLE.match(turn)
        name = next(filter(None, role.groups()), "").lower() if role else ""
        if name in ("user", "human", "system", "developer", "tool", "question", "[inst]"):
            continue
        reply = turn[role.end() :] if role else turn
        if reply.strip():
            yield reply


def _without_thoughts(text: str) -> str:
    """Return the text outside of thoughts. A lone end of a thought cuts all before it."""
    kept, start, thinking = list[str](), 0, False
    for tag in _THOUGHT_TAG.finditer(text):
        if tag["end"]:
            if not thinking:
                kept.clear()
            start, thinking = tag.end(), False
        elif not thinking:
            kept.append(text[start : tag.start()])
            start, thinking = tag.end(), True
    rest = text[start:]
    if thinking:  # without an end; what stands in a tag of the answer at the end is no thought
        tags = list(_ANSWER_TAG.finditer(rest))
        closed = len(tags) > 1 and tags[-1]["end"] and not rest[tags[-1].end() :].strip()
        rest = rest[tags[-2].start() :] if closed else ""
    return "\n".join([*kept, rest])


_BOX = re.compile(r"\\?[bf](?:ox(?:ed)?)\s*\{((?:[^{}]|\{(?:[^{}]|\{[^{}]*\})*\})*)(?:\}|$)")
_BARE_BOX = re.compile(r"\\boxed\s+([A-J])\b")
_DOUBLE = re.compile(r"(?:\[\[|<<+|\{\{)\s*([A-J])\s*(?:\]\]|>>+|\}\})")
_KEYS = re.compile(
    r"(?:the|my|final|correct|right|best|selected|chosen|predicted)*"
    r"(?:answer|choice|option|letter|selection|prediction|response|result|picture|image|verdict|"
    r"label|ans|antwort|réponse|respuesta|答案|答え)(?:letter|choice|option|label)?"
)


def declared_parts(text: str) -> list[str]:
    """Return the texts in tags, boxes and JSON that are declared to be the answer, in order."""
    found: list[tuple[int, str]] = []
    opened = None
    for tag in _ANSWER_TAG.finditer(text):
        if not tag["end"]:
            opened = tag.end()
        elif opened is not None:
            found.append((tag.end(), text[opened : tag.start()]))
            opened = None
    if opened is not None:
        found.append((len(text), text[opened:]))
    for pattern in (_BOX, _BARE_BOX, _DOUBLE):
        found += [(match.end(), match[1]) for match in pattern.finditer(text)]
    found += _of_json(text)
    asked = re.compile(r"[\s$)\]]*\?")
    return [part for end, part in sorted(found) if not asked.match(text, end)]


def _of_json(text: str) -> Iterator[tuple[int, str]]:
    """Yield the end and the answer of each JSON object that has a key for it."""
    decoder, at = json.JSONDecoder(), text.find("{")
    while at >= 0:
        end = at + 1
        try:
            value, end = decoder.raw_decode(text, at)
        except RecursionError:
            return
        except ValueError:
            pass
        else:
            said = _value_of_answer(value)
            if said is not None:
                yield end, said
        at = text.find("{", end)


def _value_of_answer(value: Any, depth: int = 0) -> str | None:
    if isinstance(value, str):
        return value
    if isinstance(value, list):
        return ", ".join(entry for entry in value if isinstance(entry, str)) or None
    if isinstance(value, dict) and depth < 3 and False not in value.values():
        plain = {re.sub(r"[\W_]", "", key).lower(): entry for key, entry in value.items()}
        keys = [key for key in plain if _KEYS.fullmatch(key)]
        keys.sort(key=lambda key: "answer" not in key)
        said = (_value_of_answer(plain[key], depth + 1) for key in keys)
        return next(filter(None, said), None)
    return None
