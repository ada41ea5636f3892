"""The letters that a text names, and what the words around each say of it."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace

from iqtt.vlm.words import (
    ABOUT_ANSWER,
    AFTER_ANSWER,
    ASIDE,
    BAD,
    BAD_WORD,
    BEFORE_ANSWER,
    BEFORE_BELIEF,
    BEFORE_IS,
    BEFORE_SO,
    BELIEF,
    BELIEF_WORD,
    BREAK,
    CHOOSE,
    DENIAL,
    DENIAL_AT_END,
    EARLIER,
    FILLER,
    GOOD,
    GOOD_WORD,
    HARMLESS,
    IN_DOUBT,
    LEAD_IN,
    NOT_WORD,
    NOUN,
    OF_ANSWER,
    THAT,
    TURN,
    any_of,
    compiled,
)


def _with_capital(match: re.Match[str]) -> str:
    """Return the match with its last letter of an answer as a capital."""
    found = match[0]
    last = max(i for i, c in enumerate(found) if c in "abcdefghijABCDEFGHIJ")
    return found[:last] + found[last].upper() + found[last + 1 :]


CJK = r"[\u3040-\u30ff\u3400-\u9fff\uac00-\ud7af]"
# A letter by itself. I is the pronoun unless it ends a sentence.
L = r"[\"'(\[{<]{0,4}(?:[A-HJ]|I(?=\W*$))[)\]}>\"']*(?![\w+-]|'(?!s\b))"
_OR = any_of("or|and|nor|und|oder|et|ou|y|o")
_NEXT = rf"(?=\s*[\"'(\[]*[A-J]\W*(?:$|[,/]|{any_of('or|and|nor')}))"
_SINGULAR = any_of("is|has|was|shows|matches|does|differs")
_JOIN = (
    rf"\s*(?:,\s*{_OR}|[/&|+]|,{_NEXT}"
    rf"|\band\b(?!\s*(?:{NOUN})?[\"'(\[]*[A-J]\W*\s{_SINGULAR})"
    rf"|{any_of('or|nor|und|oder|et|ou|y|o|e|vs|as well as')}\.?|和|或|与|跟|と|か|또는|와|과)"
    r"\s*(?:both\s+|also\s+)?"
)
MENTION = re.compile(  # one letter, or several that are joined: "A, B or C"
    rf"(?i:{NOUN})?(?<![\w'\\.-]){L}"
    rf"(?:(?:\s*,\s*(?i:{_OR}\s+)?{L}){{2,}}|(?:(?i:{_JOIN}(?:{NOUN})?){L})*)"
)
SENTENCE_END = re.compile(r"(?<=[.!?;])\s+|[\n;]|(?<=[!?])")
# Words that follow the letter A, and not the article.
_AFTER_A = any_of(
    """is|isn't|was|are|has|have|shows?|match(?:es)?|does|doesn't|do|don't|can|cannot|can't|could
    would|will|must|should|may|might|looks?|appears?|seems?|fits?|equals?|depicts?|differs?|wins
    represents?|corresponds?|mirrors?|and|or|nor|because|since|as|but|by|in|for|to|than|instead
    rather|with|without|due|based|if|when|while|then|not|no|it|only|over|vs|versus|correctly
    ist|zeigt|und|oder|nicht|weil|est|et|ou|ne|n'est|montre|parce|car|es|y|o|muestra|porque|[A-J]"""
)
_ARTICLE = rf"(?P<named>(?i:{NOUN}))?(?<![\w\"'(\[])A(?=\s+(?!(?i:{_AFTER_A}))[A-Za-zà-ÿ0-9])"
_ENDS = r"(?=\s*(?:[.,;!?](?!\w)|$))"
# Small letters that are surely names of answers.
_SMALL = [
    rf"(?:{NOUN}|{any_of('is|ist|est|es|be')}\s+|[:=]\s*)[\"'(\[]*[a-j][\"')\]]*{_ENDS}",
    r"(?<![\w)])[(\[][a-j][)\]](?!\w)",
    rf"{NOUN}(?:[bc](?=\s)|a(?=\s+(?:is|shows|matches)\b))",
    rf"(?:{OF_ANSWER}\s+is|{CHOOSE})\s+[bc](?=\s)",
    rf"{BELIEF}{THAT}[bc](?=\W*$|\s+because)|^\W*its\s+[bc](?=\W*$)",
    r"^\W*[a-j]\W*$",
    rf"^\W*[a-c](?=\s*[):]\s)|(?<![\w'])[a-c](?=\s+is\s+(?:the\s+)?(?:{GOOD}|{BAD}))",
    r"^\W*[bc](?=\s+(?:because|since|as|is|matches|shows)\b)",
]
# "the second one, B", "the picture in the middle (B)"
_PLACE = (
    r"\bthe\s+(?:(?:first|second|third|last|middle|left|right)\s+)?"
    r"(?:one|picture|image|option|shape)(?:\s+(?:in|on|at|to)\s+the\s+\w+)?\s*[,:(]\s*"
)
_YES = any_of("yes|yep|correct|no|nope|wrong|match|same|mirror(?:ed)?|different")
_SHARE = r"[\s(:=-]*(?:(?:confidence|probability|score|p)\W{0,3})?\d*\.?\d+\s*%?\)?"
_MARKS = "✓✔✅☑✗✘❌✖"
# What makes plain sentences of a text: patterns with their replacements, in this order.
_PLAIN: list[tuple[re.Pattern[str], str | Callable[[re.Match[str]], str]]] = [
    (re.compile(r"<([A-J])>(?!.*</\1>)", re.DOTALL), r"(\1)"),  # "<B>", and no "<B>bold</B>"
    (re.compile(r"<[^<>\n]{1,60}>"), " "),  # tags
    (re.compile(r"[\\\t](?:text(?:bf|rm|it)?|math(?:bf|rm|sf)|bf|rm|mbox)\s*\{([^{}]*)\}"), r"\1"),
    (re.compile(r"\\n(?![a-z])"), "\n"),  # an escaped end of a line
    (re.compile(r"(?<=[A-Za-z])_(?=[A-J]\b)|\[[xX]\](?=\s*\W?[A-J]\b)"), " "),
    # "A 40%, B 60%" names both; "A ❌ B ✅" has an entry for each.
    (
        re.compile(rf"^(\W*{L}){_SHARE}\s*(?:[,;/]|or\b|and\b)\s*(?={L}{_SHARE})", re.MULTILINE),
        r"\1 or ",
    ),
    (
        re.compile(rf"^(?:[A-J][^\w\n]*?[{_MARKS}][^\w\n]*){{2,}}$", re.MULTILINE),
        lambda match: re.sub(f"(?<=[{_MARKS}])", "\n", match[0]),
    ),
    (re.compile(r"(?<=[a-z])~(?=[A-J]\b)"), " "),
    # Marks of Markdown and LaTeX, and white space at the starts of lines.
    (re.compile(r"```\w*|[*_`$~#]|\\[()\[\]]|^[^\S\n]*(?:>[^\S\n]*)+|^[^\S\n]+", re.MULTILINE), ""),
    # Scripts without spaces get some around letters, so that these stand by themselves.
    (re.compile(rf"(?<={CJK})(?=[A-Za-z(\"\[])|(?<=[A-Za-z)\"\]])(?={CJK})"), " "),
    (compiled(r"\b(fig|pic|opt|ans|img)\.(?=\s*\W?[A-Ja-j]\b)"), r"\1"),
    (re.compile(r"^\s*(?:[-•·–—+]+\s*|\(?\d+[.)]\s+)(?=\S)", re.MULTILINE), ""),  # of lists
    (re.compile(rf"(?i:{_PLACE})(?={L})"), ""),
    *((re.compile(small, re.IGNORECASE | re.MULTILINE), _with_capital) for small in _SMALL),
    (re.compile(rf"\b([A-J])\?\s*(?=(?i:{_YES}))"), r"\1: "),  # "A? No."
    (compiled(any_of("(?:anything|everything|everyone|all|any) but")), "except"),
    (re.compile(r":\s*\n\s*"), ": "),  # "Answer:", and the letter in the next line
    (re.compile(r"^(\W{0,2}[A-J]\W?)[.)]+[ \t]+(?=\S)", re.MULTILINE), r"\1: "),  # "B. It has"
    (compiled(any_of("if (?:i (?:had|have|must)(?: to)?|forced to) (?:guess|choose)")), "probably"),
    (compiled(any_of(r"on (?:second thoughts?|(?:\w+ )?(?:reflection|inspection))")), "actually"),
    (HARMLESS, " "),
    (re.compile(_ARTICLE), lambda match: match[0] if match["named"] else "a"),
]


@dataclass(frozen=True)
class Mention:
    """Letters that stand together, and what is said of them.

    Attributes:
        letters: such as A and B of "A or B".
        standing: "declared" to be the answer; "alone", without words; "believed"; "said" to show
            the same shape; "label", before a remark that tells neither; "denied", or compared, or
            asked; "" where nothing is told.
        labelled: whether they begin a line, or an entry of a list, as in "B: same".
    """

    letters: frozenset[str]
    standing: str
    labelled: bool


def mentions(text: str, offered: str) -> list[Mention]:
    """Return the letters that a text names, in order. All `offered` ones together are no answer."""
    for pattern, plain in _PLAIN:
        text = pattern.sub(plain, text)
    sentences = [sentence for sentence in SENTENCE_END.split(text) if sentence.strip()]
    return [m for one in sentences for m in _of_sentence(one, offered, len(sentences) == 1)]


def _of_sentence(sentence: str, offered: str, only: bool) -> list[Mention]:
    """Return the letters that a sentence names, in order, each with its standing.

    Args:
        only: whether this is all of the text. Then "B?" is an answer.
    """
    found = [m for m in MENTION.finditer(sentence) if _named(m[0])]
    found = [m for m in found if not (len(_named(m[0])) > 1 and _named(m[0]) == set(offered))]
    alone = not FILLER.sub("", MENTION.sub("", sentence))
    asked = sentence.rstrip().endswith("?") and not only
    made, listed, doubtful = list[Mention](), False, False
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
            after = DENIAL_AT_END.sub("", after)  # "B rather than A"
        standing = "" if asked else _standing(before, after, label, i == 0)
        if alone and not asked and standing not in ("declared", "denied", "said"):
            standing = "alone"
        letters = frozenset(_named(mention[0]))
        if doubtful and "denied" not in (standing, made[-1].standing):  # "B, or maybe A"
            made[-1] = replace(made[-1], letters=made[-1].letters | letters)
        doubtful = not last and IN_DOUBT.fullmatch(after) is not None
        made.append(Mention(letters, standing, label))
    return made


def _named(mention: str) -> set[str]:
    return set(re.findall(r"(?<![A-Za-z])[A-J](?![A-Za-z])", mention))


def _standing(before: str, after: str, label: bool, first: bool) -> str:
    """Return the standing of a letter from the words before and after it, up to other letters."""
    tail = BREAK.split(before)[-1]  # the clause that the letter stands in
    head = BREAK.split(after, maxsplit=1)[0]
    ends = not FILLER.sub("", BELIEF_WORD.sub("", head))
    about = ABOUT_ANSWER.search(before) and not ASIDE.search(tail)
    same_before = ends and GOOD_WORD.search(before) and not ASIDE.search(before)
    same_after = GOOD_WORD.search(after) and not (NOT_WORD.search(after) or ASIDE.search(after))
    rules = (  # the first that holds
        ("denied", DENIAL.search(tail) or BAD_WORD.search(head)),
        ("denied", EARLIER.search(TURN.split(before)[-1])),
        ("declared", BEFORE_IS.search(before) and about),
        ("declared", BEFORE_ANSWER.search(before) or AFTER_ANSWER.search(head)),
        ("declared", BEFORE_SO.search(before) and ends),
        ("denied", BAD_WORD.search(after)),
        ("believed", BEFORE_BELIEF.search(before) and ends),
        ("alone", ends and first and not before.strip()),
        ("alone", ends and first and LEAD_IN.fullmatch(before) and not DENIAL.search(before)),
        ("said", same_before and not DENIAL.search(before)),  # "the reference matches B"
        ("said", same_after and not same_before),  # "B matches the reference"
        ("label", label),
    )
    return next((standing for standing, holds in rules if holds), "")
