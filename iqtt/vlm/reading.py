"""Which answer a model's text names: one function for every harness.

1. `_replies` takes away what is no reply: thoughts, other turns, marks of chat templates.
2. Tags, boxes and JSON that declare their content to be the answer decide.
3. Else every letter that is named gets a standing from the words around it, see `_standings`.
4. The strongest standing decides. Where that names several letters, the text has no answer.

The forms are those of the chat templates of open models and of the parsers of vLLM, SGLang,
VLMEvalKit and lmms-eval. A text that a careful person would call unclear stays unread.
"""

import html
import json
import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

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
    text = _characters(text)
    letters: set[str] = set()
    for reply in _replies(text):
        letters = _letters(reply, LETTERS[:answers], cut_off)
        if letters:
            break
    index = LETTERS.find(next(iter(letters))) if len(letters) == 1 else -1
    answer = index if 0 <= index < answers else None
    if cut_off:
        return Reading(answer, "cut off")
    if answer is not None:
        return Reading(answer, "answered")
    refused = not letters and any(map(_REFUSAL.search, _replies(text)))
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
        return f"all of {rows} replies name a letter"
    quoted = [f"{name}: {_quoted(text)}" for name, text in unread[:QUOTED]]
    share = f"{len(unread)} of {rows} replies name no letter ({len(unread) / rows:.0%})"
    return f"{share}, such as {'; '.join(quoted)}"


def _quoted(text: str) -> str:
    """Return the end of a text, where an answer would stand, as one line that prints."""
    line = " ".join(text.split()).encode(errors="replace").decode()
    line = "".join(c if c.isprintable() else "?" for c in line)
    return json.dumps(line if len(line) <= QUOTE else f"...{line[3 - QUOTE:]}", ensure_ascii=False)


def is_thought_alone(text: str) -> bool:
    """Return whether a text holds nothing outside of the model's thoughts."""
    return not any(_replies(_characters(text)))


# ---- what is the reply ----

_SAME_AS = str.maketrans(
    {
        **dict.fromkeys("“”„«»「」『』〝〟", '"'), **dict.fromkeys("‘’‚`´", "'"),
        **{"【": "[", "】": "]", "。": ". ", "、": ", ", "▁": "_", "Ġ": " ", "Ċ": "\n", "\x08": "\\b"},
        **dict.fromkeys("\u200b\u200c\u200d\u200e\u200f\u2060\ufeff\u00ad\ufe0e\ufe0f\u20e3", ""),
        **{chr(base + i): LETTERS[i] for base in (0x1F150, 0x1F170) for i in range(10)},
    }
)  # fmt: skip
_THOUGHT = (
    r"(?:(?!no)[\w:-]*(?:think|thought|reason(?!able)|reflection|scratchpad|monologue)[\w-]*|analysis|cot)"
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
    (rf"{_CHANNEL}(?:analysis|commentary)\b[^<]*(?:<\|constrain\|>[^<]*)?<\|message\|>", "<think>"),
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


def _characters(text: str) -> str:
    """Return the text with plain characters, and without long runs of one that is no letter."""
    plain = unicodedata.normalize("NFKC", html.unescape(text)).translate(_SAME_AS)
    return re.sub(r"([\W_])\1{3,}", r"\1\1\1", re.sub(r"[^\S\n]+", " ", plain))


def _replies(text: str) -> Iterator[str]:
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


# ---- what declares its content to be the answer ----

_BOX = re.compile(r"\\?[bf](?:ox(?:ed)?)\s*\{((?:[^{}]|\{(?:[^{}]|\{[^{}]*\})*\})*)(?:\}|$)")
_BARE_BOX = re.compile(r"\\boxed\s+([A-J])\b")
_DOUBLE = re.compile(r"(?:\[\[|<<+|\{\{)\s*([A-J])\s*(?:\]\]|>>+|\}\})")
_KEYS = re.compile(
    r"(?:the|my|final|correct|right|best|selected|chosen|predicted)*"
    r"(?:answer|choice|option|letter|selection|prediction|response|result|picture|image|verdict|"
    r"label|ans|antwort|réponse|respuesta|答案|答え)(?:letter|choice|option|label)?"
)


def _declared_parts(text: str) -> list[str]:
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


# ---- words ----


def _words(latin: str, other: str = "") -> str:
    """Return a pattern of any of these words; those of `other` scripts have no spaces around."""
    return rf"(?:\b(?:{latin})\b|{other})" if other else rf"\b(?:{latin})\b"


_NOUN = (
    r"(?:\b(?:the\s+|la\s+|el\s+|die\s+|das\s+)?(?:candidate\s+)?(?:picture|image|option|choice|"
    r"answer|figure|candidate|letter|shape|panel|object|bild|abbildung|figur|antwort|buchstabe|"
    r"réponse|lettre|imagen|opción|fig|pic|opt|img|respuesta|figura|letra|immagine|opzione|imagem|opção)s?\b"
    r"|选项|選項|图片|圖片|图像|图|圖|選択肢|画像|図|答案|答え|그림|보기)\s*#?\s*"
)
_OF_ANSWER = _words(
    r"answer|ans|solution|verdict|conclusion|final|choice|pick|selection|guess|decision|prediction|"
    r"response|option|letter|bet|remain(?:s|ing)|antwort|lösung|wahl|réponse|choix|respuesta|solución|elección|"
    r"opción|risposta|scelta|resposta|antwoord|ответ|đáp\s+án",
    "الجواب|उत्तर|答案|答え|正解|回答|解答|选择|選択|选项|정답|답",
)
_GOOD = _words(
    r"rotat\w+\s+(?:(?:version\s+)?of\s+)?(?:the\s+)?(?:into|reference)|same|match(?:es|ing|ed)?|identical|correct|congruent|equivalent|fits?|fitting|corresponds?|"
    r"corresponding|best|yes|true|most similar|closest|(?:is|be)\s+right|right\s+(?:one|answer|"
    r"choice|option|picture|image|match|shape|figure)|gleich\w*|dasselbe|dieselbe\w*|derselbe\w*|"
    r"richtig\w*|korrekt\w*|passt|passende?|stimmt|identisch\w*|même|correcte|bonne?|correspond|"
    r"identique|mism[oa]|correct[oa]|coincide|idéntic[oa]|corrett[oa]|stess[oa]|corret[oa]",
    "相同|一致|正确|正確|匹配|吻合|一样|同じ|正しい|正解|같은|맞|[✓✔✅☑]",
)
_BAD = _words(
    r"mirror\w*|reflect(?:ed|ions?|s)|flipped|inverted|wrong|incorrect\w*|different(?!\s+(?:\w+\s+)?"
    r"(?:angle|view\w*|orientation|perspective|direction|rotation|pose|position|side))|differs?|"
    r"distinct|mismatch\w*|false|fails?|invalid|opposite|enantiomer\w*|runner-?up|(?:second|2nd|third|3rd|next|other|alternative)"
    r"[\s-]+(?:best|choice|option|guess)|alternatives?|least|distractors?|decoys?|gespiegelt\w*|spiegel\w+|falsch\w*|anders|verschieden\w*|"
    r"unterscheidet|miroir|fausse?|faux|incorrecte?s?|différent\w*|espejo|espejad[oa]s?|"
    r"reflejad[oa]s?|incorrect[oa]s?|diferentes?|distint[oa]s?|equivocad[oa]s?|speculare|errat[oa]",
    "镜像|鏡像|错误|錯誤|不同|異な|違|間違|左右反|[✗✘❌✖]",
)
_NOT = _words(
    r"not|\w*n't|cannot|never|neither|nor|no|none|without|hardly|nicht|kein\w*|weder|noch|pas|ne|"
    r"jamais|aucun\w*|nunca|tampoco|ningun\w*|ni|non|não",
    "不|没|沒|并非",
)
_OTHER = _words(  # what stands before a letter that is compared with, or left out
    r"than|unlike|instead\s+of|opposed\s+to|over|versus|vs|except(?:\s+for)?|exclud\w*|"
    r"eliminat\w*|reject\w*|rul\w+\s+out|discard\w*|dismiss\w*|avoid\w*|doubt\w*|unlikely|impossible|almost|nearly|least|"
    r"(?:might|may|could)\s+(?:\w+\s+)?(?:choose|pick|select|say|think)|compared\s+(?:to|with)|"
    r"similar\s+to|resembl\w+|confus\w+|tempt\w+|statt|anstatt|außer|anstelle\s+von|au\s+lieu\s+"
    r"de|sauf|en\s+(?:lugar|vez)\s+de|excepto|salvo|if|suppose|assum\w+|wenn|si|could\s+be|"
    r"might\s+be|may\s+be|would\s+have\s+been|were|was|thought",
    "排除|比|而非|除了|如果|より",
)
_EARLIER = re.compile(  # what a model thought before
    _words(r"at\s+first|first\s+(?:thought|guess|impression|glance)|initially|originally|zuerst|"
           r"zunächst|d'abord|al\s+principio|primero", "起初|一开始|最初"), re.IGNORECASE
)  # fmt: skip
_TURN = re.compile(_words("but|however|now|aber|mais|pero"), re.IGNORECASE)
_ASIDE = re.compile(  # what tells of something else than the shape, or not quite of the same one
    _words(r"number|count|colou?rs?|sizes?|lengths?|orientation|almost|nearly|partly|partially|"
           r"roughly|(?<!most\s)similar|anzahl|farbe|nombre|couleur|número|color|each|every", "数|颜色"),
    re.IGNORECASE,
)  # fmt: skip
_CHOOSE = _words(
    r"choos(?:e|es|ing)|chose|pick(?:s|ed|ing)?|select(?:s|ed|ing)?|go(?:ing)?\s+(?:with|for)|"
    r"opt(?:s|ed|ing)?\s+for|vote\s+for|settl(?:e|ed|ing)\s+(?:on|for)|decid(?:e|ed|ing)\s+(?:on|"
    r"for)|(?:change|revise|correct|switch|update)d?\s+(?:(?:my|the)\s+)?(?:answer|mind|choice)?\s*"
    r"to|i\s+meant?|inclined\s+to\s+say|lean(?:ing)?\s+towards?|prefer|switch(?:ing)?\s+to|i(?:'d|\s+would|\s+will|'ll)?\s+(?:say|answer)|answer|ans|dirais|wähle|nehme|"
    r"entscheide\s+mich\s+für|tippe\s+auf|choisis|choisirais|opte\s+pour|sélectionne|elijo|escojo|"
    r"selecciono|elegiría|me\s+quedo\s+con|scelgo|escolho|final",
    "选择|選擇|选|選|选取|判断为",
)
_IS = (
    r"(?:\b(?:is|are|be|being|ist|sind|lautet|wäre|est|serait|es|sería|è|é)\b(?:\s+(?:therefore|thus|"
    r"clearly|definitely|indeed|obviously|simply|probably|likely|most\s+likely|also|daher|donc|"
    r"bien|claramente))?|[:=]|->|=>|→|⇒|是|为|為|は|が|은|는|-)[\s:]*"
)
_MY = r"(?:\b(?:the|la|le|el|das|die|der|either|both|no\.)\s*|\bl')?"
_SO = _words(
    r"therefore|thus|hence|so|then|consequently|accordingly|finally|in\s+conclusion|in\s+summary|"
    r"overall|ultimately|(?:so\s+|then\s+)?(?:it|this|that)(?:'?s|\s+is|\s+must\s+be|\s+has\s+to\s+be|\s+would\s+be|"
    r"\s+should\s+be)|that\s+leaves|which\s+leaves|leaves|leaving|actually|scratch\s+that|correction|edit|no(?=,)|wait|(?:the\s+)?(?:picture|image|figure)\s+is|but(?:\s+rather)?|sure|okay|ok|"
    r"daher|deshalb|folglich|also|somit|sondern|es\s+ist|bleibt|donc|ainsi|alors|c'est|mais|"
    r"por\s+(?:lo\s+)?tanto|así\s+que|entonces|luego|sino|es|quindi|portanto|logo",
    "因此|所以|故|于是|而是|よって|したがって|従って|なので|따라서",
)
_BELIEF = _words(
    r"(?:i|we)(?:'d|'m|'ll|\s+would|\s+will|\s+am)?\s+(?:think|believe|guess|say|suspect|feel|reckon|conclude|"
    r"(?:pretty\s+|quite\s+|fairly\s+)?(?:sure|confident|certain))|to\s+(?:guess|choose|pick)|probably|likely|maybe|perhaps|"
    r"presumably|definitely|clearly|certainly|surely|obviously|undoubtedly|by\s+(?:process\s+of\s+)?"
    r"elimination|only|just|looks\s+like|seems\s+(?:like|to\s+be)|"
    r"appears\s+to\s+be|must\s+be|ich\s+(?:denke|glaube|meine)|vermutlich|wahrscheinlich|"
    r"je\s+(?:pense|crois)|probablement|creo|pienso|probablemente|penso|acho",
    "我认为|我觉得|我想|应该是|可能是|もちろん|おそらく|たぶん",
)
_THAT = r"\W*(?:(?:\b(?:that|dass|que|it's|its|it\s+is|es\s+ist|c'est|es)\b|是)\W*){0,2}"
_BEFORE_ANSWER = re.compile(rf"(?:{_CHOOSE})[\s:]*{_MY}$", re.IGNORECASE)
_BEFORE_IS = re.compile(rf"{_IS}\W*{_MY}$", re.IGNORECASE)
_BEFORE_SO = re.compile(rf"(?:{_SO})\W*{_MY}(?:(?:{_BELIEF}){_THAT})?$", re.IGNORECASE)
_BELIEF_WORDS = re.compile(_BELIEF, re.IGNORECASE)
_BEFORE_BELIEF = re.compile(rf"(?:{_BELIEF}){_THAT}{_MY}$", re.IGNORECASE)
_ABOUT_ANSWER = re.compile(rf"(?:{_OF_ANSWER}|{_GOOD})", re.IGNORECASE)
_AFTER_ANSWER = re.compile(
    r"^\s*(?:(?:is|must\s+be|has\s+to\s+be|ist|est|es|è|é)\s+(?:\w+\s+){0,3}?(?:answer|choice|option|pick|"
    r"selection|(?:correct|right|richtig|korrekt|correcte|correct[oa])(?=\W*$|\s+(?:one|choice))|"
    r"solution|match|one(?=\W*$)|antwort|lösung|réponse|respuesta)\b|it\s+is\b|would\s+be\s+(?:my|the)\s+(?:answer|choice|pick)(?=\W*$)"
    r"|(?:是|为)?\s*(?:正确|正確|答案)|です|だ(?!け)|である|が(?:正解|答え|正しい)|を選|と(?:思|考)|입니다|이다|[를을]\s*선택)",
    re.IGNORECASE,
)
_GOOD_WORD = re.compile(_GOOD, re.IGNORECASE)
_NOT_WORD = re.compile(rf"{_NOT}|ない|ません|않", re.IGNORECASE)
_BAD_WORD = re.compile(
    rf"(?:{_BAD}|(?:{_NOT})[^,;]{{0,40}}?(?:{_OF_ANSWER}|{_GOOD}|$)|^\W*no\b"
    r"|では(?:ない|ありません|なく)|じゃな[いく]|아니)", re.IGNORECASE
)  # fmt: skip
_DENIAL = re.compile(rf"(?:{_NOT}|{_BAD}|{_OTHER})", re.IGNORECASE)
_DENIAL_AT_END = re.compile(
    rf"[\s,(]*(?:\b(?:and|but|rather|und|et|y|mais|more|better)\b\s*)*(?:{_NOT}|{_OTHER})[\s(]*{_MY}$",
    re.IGNORECASE,
)
_BREAK = re.compile(
    rf"[,;()—–]|\s-\s|{_words('and|but|because|since|as|while|whereas|where|with|over|rather|instead|so|then|thus|hence|therefore|due|based|for|und|aber|weil|da|denn|et|parce|car|y|porque|ya|pero|which|for', '因为|因為|因|而|但')}",
    re.IGNORECASE,
)
_HARMLESS = re.compile(  # negations that deny nothing
    _words(
        r"(?:there(?:'s|\s+is)\s+)?(?:no|without(?:\s+a|\s+any)?|not?\s+in)\s+(?:doubt|question)|not?\s+"
        r"(?:hard|difficult)|not\s+only|none\s+other\s+than|nothing\s+but|"
        r"(?:not|n't|no|nicht|kein\w*|pas|sin)\s+(?:a\s+|the\s+|an\s+|its\s+|any\s+|une?\s+|ein\w*\s+)?(?:mirror\w*(?:\s+"
        r"(?:images?|versions?))?|reflect\w*|flipped|inverted|different|differences?|wrong|gespiegelt|spiegelbild\w*)|"
        r"(?:i(?:'m|\s+am)\s+)?not\s+(?:\w+\s+)?(?:sure|certain)|can(?:not|'t)\s+be\s+"
        r"(?:\w+\s+)?(?:sure|certain)|ohne\s+zweifel|sans\s+(?:aucun\s+)?doute|sin\s+duda",
        "毫无疑问|无疑",
    ),
    re.IGNORECASE,
)  # fmt: skip

# ---- letters and their standing ----

_CJK = r"[\u3040-\u30ff\u3400-\u9fff\uac00-\ud7af]"
_L = r"[\"'(\[{<]{0,4}(?:[A-HJ]|I(?=\W*$))[)\]}>\"']*(?![\w+-]|'(?!s\b))"
_LETTER = rf"(?<![\w'\\.-]){_L}"
_JOIN = (
    rf"\s*(?:,\s*(?:or|and|nor|und|oder|et|ou|y|o)\b|[/&|+]|,(?=\s*[\"'(\[]*[A-J]\W*(?:$|[,/]|\b(?:or|and|nor)\b))"
    rf"|\band\b(?!\s*(?:{_NOUN})?[\"'(\[]*[A-J]\W*\s(?:is|has|was|shows|"
    r"matches|does|differs)\b)|\b(?:or|nor|und|oder|et|ou|y|o|e|vs\.?|"
    r"as\s+well\s+as)\b|和|或|与|跟|と|か|또는|와|과)\s*(?:both\s+|also\s+)?"
)
_MENTION = re.compile(
    rf"(?i:{_NOUN})?{_LETTER}"
    rf"(?:(?:\s*,\s*(?i:(?:or|and|nor|und|oder|et|ou|y|o)\s+)?{_L}){{2,}}|(?:(?i:{_JOIN}(?:{_NOUN})?){_L})*)"
)
_SENTENCE_END = re.compile(r"(?<=[.!?;])\s+|[\n;]|(?<=[!?])")
_VERBS = (  # words that follow the letter A, and not the article
    r"is|isn't|was|are|has|have|shows?|match(?:es)?|does|doesn't|do|don't|can|cannot|can't|could|would|"
    r"will|must|should|may|might|looks?|appears?|seems?|fits?|equals?|depicts?|differs?|represents?|"
    r"corresponds?|and|or|nor|because|since|as|but|by|in|for|to|than|instead|rather|with|without|due|"
    r"based|if|when|while|then|not|no|it|only|ist|zeigt|und|oder|nicht|weil|est|et|ou|ne|n'est|montre|"
    r"parce|car|es|y|o|muestra|porque|mirrors?|over|vs|versus|correctly|wins"
)
_ARTICLE = re.compile(
    rf"(?P<named>(?i:{_NOUN}))?(?<![\w\"'(\[])A(?=\s+(?!(?:(?i:{_VERBS})|[A-J])\b)[A-Za-zà-ÿ0-9])"
)
_TO_CASE = [  # small letters that are surely names of answers
    re.compile(rf"({_NOUN}|\b(?:is|ist|est|es|be)\s+|[:=]\s*)[\"'(\[]*[a-j][\"')\]]*(?=\s*(?:[.,;!?](?!\w)|$))",
               re.IGNORECASE | re.MULTILINE),
    re.compile(r"(?<![\w)])[(\[][a-j][)\]](?!\w)"),
    re.compile(rf"{_NOUN}(?:[bc](?=\s)|a(?=\s+(?:is|shows|matches)\b))", re.IGNORECASE),
    re.compile(rf"(?:(?:{_OF_ANSWER})\s+is|{_CHOOSE})\s+[bc](?=\s)", re.IGNORECASE),
    re.compile(rf"(?:{_BELIEF}){_THAT}[bc](?=\W*$|\s+because)|^\W*its\s+[bc](?=\W*$)", re.IGNORECASE | re.MULTILINE),
    re.compile(r"^\W*[a-j]\W*$", re.MULTILINE),
    re.compile(r"^\W*[bc](?=\s+(?:because|since|as|is|matches|shows)\b)"),
]  # fmt: skip
_PLACE_OF_PICTURE = re.compile(  # "the second one, B", "the picture in the middle (B)"
    r"\bthe\s+(?:(?:first|second|third|last|middle|left|right)\s+)?(?:one|picture|image|option|shape)"
    rf"(?:\s+(?:in|on|at|to)\s+the\s+\w+)?\s*[,:(]\s*(?={_L})", re.IGNORECASE
)
_IN_DOUBT = re.compile(r"\W*(?:(?:and|or|maybe|perhaps|possibly|probably)\W*)+|\s+|\s*,\s*", re.IGNORECASE)
_FILLER = re.compile(
    rf"{_NOUN}|{_words('only|just|definitely|clearly|sure|yes|hmm|ok|okay|final|both|either')}|[\W_]",
    re.IGNORECASE,
)
_REFUSAL = re.compile(
    r"\bi(?:'m|\s+am)\s+(?:\w+\s+)?(?:sorry|unable|not\s+able)"
    r"|(?:\bi|^)\s*(?:can\s*not|can't|won't|could\s*n't|am\s+not\s+going\s+to)\s+(?!be\s+(?:\w+\s+)?"
    r"(?:sure|certain)|say\s+for|choose|pick|select)"
    r"|\bi\s+(?:refuse|decline|must\s+decline)|unable\s+to\s+(?:see|view|determine|help|answer|"
    r"process|identify|assist)|no\s+images?\s+(?:was|were|is|are|has|have|provided|attached)|as\s+an?\s+"
    r"(?:ai|language)\b|^\W*sorry\b|without\s+the\s+images?\s+provided|(?:don't|do\s+not)\s+(?:see|have)\s+(?:any\s+|an\s+|the\s+)?"
    r"(?:image|picture|ability|access)|es\s+tut\s+mir\s+leid|ich\s+kann\s+(?:\w+\s+){0,4}?(?:nicht|kein\w*)\b|je\s+(?:suis\s+désolée?|ne\s+peux\s+pas)|"
    r"désolée?\b|lo\s+siento|no\s+puedo|抱歉|对不起|對不起|无法|無法|不能(?:看|回答|协助|提供)|"
    r"申し訳|すみません|ごめん|できません|お答えでき|죄송",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class _Mention:
    letters: frozenset[str]
    standing: str  # "declared", "alone", "believed", "said", "label", "denied" or ""
    labelled: bool  # "B: ..." at the start of a line or of an entry


def _letters(text: str, offered: str, cut_off: bool) -> set[str]:
    """Return the letters that a reply answers with: one, several where it is unclear, or none."""
    for part in reversed(_declared_parts(text)):
        letters = _letters(part, offered, False)
        if letters:
            return letters
    return _letters_in_prose(text, offered, cut_off)


def _letters_in_prose(text: str, offered: str, cut_off: bool) -> set[str]:
    sentences = _sentences(text)
    mentions = [m for one in sentences for m in _standings(one, offered, len(sentences) == 1)]
    declared = [i for i, mention in enumerate(mentions) if mention.standing == "declared"]
    if declared:
        last = mentions[declared[-1]]
        later = [m for m in mentions[declared[-1] + 1 :] if m.standing == "denied"]
        taken_back = any(last.letters == mention.letters for mention in later)
        return set(LETTERS) if taken_back else set(last.letters)
    denied = {x for m in mentions if m.standing == "denied" for x in m.letters}
    labels = {x for m in mentions if m.labelled for x in m.letters}
    if cut_off:
        mentions = mentions if len(mentions) == 1 and len(_FILLER.sub("", text)) == 1 else []
    for standing in ("alone", "believed", "said", "label"):
        letters = {x for m in mentions if m.standing == standing for x in m.letters}
        letters = letters if len(letters) > 1 else letters - denied
        if letters and (standing != "label" or len(labels) == 1):
            return letters
    return set()


def _sentences(text: str) -> list[str]:
    """Return the sentences of a text as plain words, without marks of Markdown and LaTeX."""
    text = re.sub(r"<([A-J])>(?!.*</\1>)", r"(\1)", text, flags=re.DOTALL)
    text = re.sub(r"<[^<>\n]{1,60}>", " ", text)
    text = re.sub(r"(?:\\|\t)(?:text(?:bf|rm|it)?|math(?:bf|rm|sf)|bf|rm|mbox)\s*\{([^{}]*)\}", r"\1", text)
    text = re.sub(r"\\n(?![a-z])", "\n", text)
    text = re.sub(r"(?<=[A-Za-z])_(?=[A-J]\b)|\[[xX]\](?=\s*\W?[A-J]\b)", " ", text)
    text = re.sub(r"```\w*|[*_`$~#]|\\[()\[\]]|^[\s>]+", lambda m: "\n" if "\n" in m[0] else "", text, flags=re.MULTILINE)
    text = re.sub(rf"(?<={_CJK})(?=[A-Za-z(\"\[])|(?<=[A-Za-z)\"\]])(?={_CJK})", " ", text)
    text = re.sub(r"\b(fig|pic|opt|ans|img)\.(?=\s*\W?[A-Ja-j]\b)", r"\1", text, flags=re.IGNORECASE)
    text = re.sub(r"^\s*(?:[-•·–—+]+\s*|\(?\d+[.)]\s+)(?=\S)", "", text, flags=re.MULTILINE)
    text = _PLACE_OF_PICTURE.sub("", text)
    for pattern in _TO_CASE:
        text = pattern.sub(_with_capital, text)
    text = re.sub(r"\b([A-J])\?\s*(?=(?:yes|yep|correct|no|nope|wrong)\b)", r"\1: ", text, flags=re.IGNORECASE)
    text = re.sub(r"\b(?:anything|everything|everyone|all|any) but\b", "except", text, flags=re.IGNORECASE)
    text = re.sub(r"([:：])\s*\n\s*", r"\1 ", text)
    text = re.sub(r"^(\W{0,2}[A-J]\W?)[.)]+[ \t]+(?=\S)", r"\1: ", text, flags=re.MULTILINE)
    text = re.sub(
        r"\bif (?:i (?:had|have|must)(?: to)?|forced to) (?:guess|choose|pick|decide)\b", "probably",
        text, flags=re.IGNORECASE,
    )  # fmt: skip
    text = re.sub(
        r"\bon (?:second thoughts?|(?:\w+ )?(?:reflection|inspection))\b", "actually", text,
        flags=re.IGNORECASE,
    )  # fmt: skip
    text = _ARTICLE.sub(lambda m: m[0] if m["named"] else "a", _HARMLESS.sub(" ", text))
    return [sentence for sentence in _SENTENCE_END.split(text) if sentence.strip()]


def _with_capital(match: re.Match[str]) -> str:
    found = match[0]
    last = max(i for i, c in enumerate(found) if c in "abcdefghijABCDEFGHIJ")
    return found[:last] + found[last].upper() + found[last + 1 :]


def _standings(sentence: str, offered: str, only: bool) -> list[_Mention]:
    """Return the letters that a sentence names, in order, each with its standing.

    Args:
        only: whether this is all of the text. Then "B?" is an answer.
    """
    found = [m for m in _MENTION.finditer(sentence) if _named(m[0])]
    found = [m for m in found if not (len(_named(m[0])) > 1 and _named(m[0]) == set(offered))]
    alone = not _FILLER.sub("", _MENTION.sub("", sentence))
    asked = sentence.rstrip().endswith("?") and not only
    mentions, listed, doubtful = list[_Mention](), False, False
    for i, mention in enumerate(found):
        last = i + 1 == len(found)
        before = sentence[found[i - 1].end() if i else 0 : mention.start()]
        after = sentence[mention.end() : None if last else found[i + 1].start()]
        label = bool(re.match(r"[A-J]?\s*(?::|-\s|[)\]])\s*\S", mention[0][-1] + after))
        if i and label and listed:
            before = ""  # the remark on another letter
        label = label and not before.strip()
        listed = listed or label
        if not last:
            after = _DENIAL_AT_END.sub("", after)  # "B rather than A"
        standing = "" if asked else _standing(before, after, label, i == 0)
        if alone and not asked and standing not in ("declared", "denied", "said"):
            standing = "alone"
        letters = frozenset(_named(mention[0]))
        if doubtful and "denied" not in (standing, mentions[-1].standing):  # "B, or maybe A"
            mentions[-1] = replace(mentions[-1], letters=mentions[-1].letters | letters)
        doubtful = not last and _IN_DOUBT.fullmatch(after) is not None
        mentions.append(_Mention(letters, standing, label))
    return mentions


def _named(mention: str) -> set[str]:
    return set(re.findall(r"(?<![A-Za-z])[A-J](?![A-Za-z])", mention))


def _standing(before: str, after: str, label: bool, first: bool) -> str:
    """Return the standing of a letter from the words before and after it, up to other letters."""
    head = _BREAK.split(after, maxsplit=1)[0]
    tail = _BREAK.split(before)[-1]
    if _DENIAL.search(tail) or _EARLIER.search(_TURN.split(before)[-1]) or _BAD_WORD.search(head):
        return "denied"
    ends = not _FILLER.sub("", _BELIEF_WORDS.sub("", head))
    answer = _BEFORE_IS.search(before) and _ABOUT_ANSWER.search(before) and not _ASIDE.search(tail)
    if answer or _BEFORE_ANSWER.search(before) or _AFTER_ANSWER.search(head):
        return "declared"
    if _BEFORE_SO.search(before) and ends:
        return "declared"
    if _BAD_WORD.search(after):
        return "denied"
    if ends and _BEFORE_BELIEF.search(before):
        return "believed"
    if ends and not before.strip() and first:
        return "alone"
    if ends and _GOOD_WORD.search(before) and not _ASIDE.search(before):
        return "" if _DENIAL.search(before) else "said"  # "the reference matches B"
    if _GOOD_WORD.search(after) and not (_NOT_WORD.search(after) or _ASIDE.search(after)):
        return "said"
    return "label" if label else ""
