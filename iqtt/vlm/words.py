"""Words around a letter that tell what a model means by it, as regular expressions.

A table has a line for each language. Spaces stand for any white space.
"""

import re


def any_of(latin: str, other: str = "") -> str:
    r"""Return a pattern of any of these words.

    Args:
        latin: alternatives that stand between boundaries of words, in lines.
        other: alternatives of scripts that have none.
    """
    lines = [line.strip() for line in latin.splitlines() if line.strip()]
    pattern = rf"\b(?:{'|'.join(lines)})\b".replace(" ", r"\s+")
    return f"(?:{pattern}|{other})" if other else f"(?:{pattern})"


def compiled(pattern: str) -> re.Pattern[str]:
    """Return a pattern that takes capitals for small letters, and ^ for the start of the text."""
    return re.compile(pattern, re.IGNORECASE)


# What an answer is called, before its letter: "picture B".
NOUN = (
    any_of(
        """(?:the |candidate )*(?:picture|image|option|choice|answer|figure|candidate|letter)s?
        (?:the )?(?:shape|panel|object|fig|pic|opt|img)s?
        (?:die |das )?(?:bild|abbildung|figur|antwort|buchstabe)
        (?:la )?(?:réponse|lettre)
        (?:la |el )?(?:imagen|opción|respuesta|figura|letra|immagine|opzione|imagem|opção)""",
        "选项|選項|图片|圖片|图像|图|圖|選択肢|画像|図|答案|答え|그림|보기",
    )
    + r"\s*#?\s*"
)
# What declares that an answer follows: "the solution is", "Antwort:".
OF_ANSWER = any_of(
    r"""answer|ans|solution|verdict|conclusion|final|choice|pick|selection|guess|decision
    prediction|response|result|output|label|option|letter|bet|remain(?:s|ing)
    antwort|lösung|wahl
    réponse|choix
    respuesta|solución|elección|opción
    risposta|scelta|resposta|antwoord|ответ|đáp án|cevap|yanıt""",
    "الجواب|الإجابة|उत्तर|答案|答え|正解|回答|解答|选择|選択|选项|정답|답",
)
GOOD = any_of(
    r"""same|match(?:es|ing|ed)?|identical|correct|congruent|equivalent|fits?|fitting|best|yes|true
    correspond(?:s|ing)?|most similar|closest|(?:is|be) right
    right (?:one|answer|choice|option|picture|image|match|shape|figure)
    rotat\w+ (?:(?:version |view |copy )?of )?(?:the )?(?:into|reference)
        (?:obtained|made) from the reference
    gleich\w*|dasselbe|dieselbe\w*|derselbe\w*|richtig\w*|korrekt\w*|passt|passende?|stimmt
    identisch\w*
    même|correcte|bonne?|correspond|identique
    mism[oa]|correct[oa]|coincide|idéntic[oa]
    corrett[oa]|stess[oa]|corret[oa]""",
    "相同|一致|正确|正確|匹配|吻合|一样|同じ|正しい|正解|같은|맞|[✓✔✅☑]",
)
BAD = any_of(
    r"""mirror\w*|reflect(?:ed|ions?|s)|flipped|inverted|wrong|incorrect\w*|differs?|distinct
    different(?! (?:\w+ )?(?:angle|view\w*|orientation|perspective|direction|rotation|pose|side))
    mismatch\w*|false|fails?|invalid|opposite|enantiomer\w*|runner-?up|least|odd|distractors?|decoys?
    (?:second|2nd|third|3rd|next|other|alternative)[\s-]+(?:best|choice|option|guess)|alternatives?
    gespiegelt\w*|spiegel\w+|falsch\w*|anders|verschieden\w*|unterscheidet
    miroir|fausse?|faux|incorrecte?s?|différent\w*
    espejo|espejad[oa]s?|reflejad[oa]s?|incorrect[oa]s?|diferentes?|distint[oa]s?|equivocad[oa]s?
    speculare|errat[oa]""",
    "镜像|鏡像|错误|錯誤|不同|異な|違|間違|左右反|[✗✘❌✖]",
)
NOT = any_of(
    r"""not|\w*n't|cannot|never|neither|nor|no|none|without|hardly
    nicht|kein\w*|weder|noch
    pas|ne|ni|jamais|aucun\w*
    nunca|tampoco|ningun\w*|non|não""",
    "不|没|沒|并非",
)
# What stands before a letter that is compared with, left out, or only supposed.
OTHER = any_of(
    r"""than|unlike|instead of|opposed to|over|versus|vs|compared (?:to|with)|similar to|resembl\w+
    except(?: for)?|exclud\w*|eliminat\w*|reject\w*|rul\w+ out|discard\w*|dismiss\w*|avoid\w*
    doubt\w*|unlikely|impossible|almost|nearly|least|confus\w+|tempt\w+|if|suppose|assum\w+
    (?:could|might|may) be|(?:might|may|could) (?:\w+ )?(?:choose|pick|select|say|think)
    would have been|were|was|thought
    statt|anstatt|außer|anstelle von|wenn
    au lieu de|sauf|si
    en (?:lugar|vez) de|excepto|salvo""",
    "排除|比|而非|除了|如果|より",
)
CHOOSE = any_of(
    r"""choos(?:e|es|ing)|chosen?|bet on|pick(?:s|ed|ing)?|select(?:s|ed|ing)?
    go(?:ing)? (?:with|for)
    opt(?:s|ed|ing)? for|vote for|settl(?:e|ed|ing) (?:on|for)|decid(?:e|ed|ing) (?:on|for)
    (?:change|revise|correct|switch|update)d? (?:(?:my|the) )?(?:(?:answer|mind|choice) )?to
    i meant?|inclined to say|lean(?:ing)? towards?|prefer|switch(?:ing)? to|answer|ans|final
    i(?:'d| would| will|'ll)? (?:say|answer)
    wähle|nehme|entscheide mich für|tippe auf
    choisis|choisirais|opte pour|sélectionne|dirais
    elijo|escojo|selecciono|elegiría|me quedo con
    scelgo|escolho""",
    "选择|選擇|选|選|选取|判断为",
)
SO = any_of(
    r"""therefore|thus|hence|so|then|consequently|accordingly|finally|overall|ultimately
    in conclusion|in summary|(?:that |which )?leaves|leaving|but(?: rather)?|sure|okay|ok
    (?:so |then )?(?:it|this|that)(?:'?s| is| (?:must|has to|would|should|c(?:an|ould) only) be)
    actually|scratch that|correction|edit|no(?=,)|wait|(?:the )?(?:picture|image|figure) is
    daher|deshalb|folglich|also|somit|sondern|es ist|bleibt
    donc|ainsi|alors|c'est|mais
    por (?:lo )?tanto|así que|entonces|luego|sino|es
    quindi|portanto|logo""",
    "因此|所以|故|于是|而是|よって|したがって|従って|なので|따라서",
)
BELIEF = any_of(
    r"""(?:i|we)(?:'d|'m|'ll| would| will| am)? (?:think|believe|guess|say|suspect|feel|reckon)
    (?:i|we)(?:'m| am)? (?:conclude|(?:pretty |quite |fairly )?(?:sure|confident|certain))
    to (?:guess|choose|pick)|probably|likely|maybe|perhaps|presumably|definitely|clearly|certainly
    surely|obviously|undoubtedly|by (?:process of )?elimination|only|just|looks like|must be
    seems (?:like|to be)|appears to be
    ich (?:denke|glaube|meine)|vermutlich|wahrscheinlich
    je (?:pense|crois)|probablement
    creo|pienso|probablemente|penso|acho""",
    "我认为|我觉得|我想|应该是|可能是|もちろん|おそらく|たぶん",
)
# Links between these and the letter.
_SURELY = any_of(
    """therefore|thus|clearly|definitely|indeed|obviously|simply|(?:most )?likely|probably
    also|daher|donc|bien|claramente"""
)
IS = (
    rf"(?:{any_of('is|are|be|being|ist|sind|lautet|wäre|est|serait|es|sería|è|é')}(?:\s+{_SURELY})?"
    r"|[:=]|->|=>|→|⇒|是|为|為|は|が|은|는|-)[\s:]*"
)
MY = rf"(?:{any_of('the|la|le|el|das|die|der|either|both|no')}\s*|\bl')?"
THAT = r"\W*(?:(?:\b(?:that|dass|que|it'?s|it\s+is|es\s+ist|c'est|es)\b|是)\W*){0,2}"

BEFORE_ANSWER = compiled(rf"{CHOOSE}[\s:]*{MY}$")
BEFORE_IS = compiled(rf"{IS}\W*{MY}$")
BEFORE_SO = compiled(rf"{SO}\W*{MY}(?:{BELIEF}{THAT})?$")
BEFORE_BELIEF = compiled(rf"{BELIEF}{THAT}{MY}$")
BELIEF_WORD = compiled(BELIEF)
ABOUT_ANSWER = compiled(rf"{OF_ANSWER}|{GOOD}")
_RIGHT = r"(?:correct|right|richtig|korrekt|correcte|correct[oa])(?=\W*$|\s+(?:one|choice)\b)"
AFTER_ANSWER = compiled(
    r"^\s*(?:(?:is|must\s+be|has\s+to\s+be|ist|est|es|è|é)\s+(?:\w+\s+){0,3}?(?:answer|choice|option"
    rf"|pick|selection|solution|match|one(?=\W*$)|antwort|lösung|réponse|respuesta|{_RIGHT})\b"
    r"|it\s+is\b|remains(?=\W*$)|is\s+left(?=\W*$)|would\s+be\s+(?:my|the)\s+(?:answer|choice|pick)(?=\W*$)"
    r"|(?:是|为)?\s*(?:正确|正確|答案)|です|だ(?!け)|である|が(?:正解|答え|正しい)|を選|と(?:思|考)"
    r"|입니다|이다|[를을]\s*선택)"
)
GOOD_WORD = compiled(GOOD)
NOT_WORD = compiled(rf"{NOT}|ない|ません|않")
BAD_WORD = compiled(
    rf"{BAD}|{NOT}[^,;]{{0,40}}?(?:{OF_ANSWER}|{GOOD}|$)|^\W*no\b"
    r"|では(?:ない|ありません|なく)|じゃな[いく]|아니"
)
DENIAL = compiled(f"{NOT}|{BAD}|{OTHER}")
DENIAL_AT_END = compiled(
    rf"[\s,(]*(?:{any_of('and|but|rather|und|et|y|mais|more|better')}\s*)*(?:{NOT}|{OTHER})[\s(]*{MY}$"
)
EARLIER = compiled(  # what a model thought before
    any_of(
        r"""at first|first (?:thought|guess|impression|glance)|initially|originally
        zuerst|zunächst|d'abord|al principio|primero""",
        "起初|一开始|最初",
    )
)
TURN = compiled(any_of("but|however|now|aber|mais|pero"))
ASIDE = compiled(  # what tells of something else than the shape, or not quite of the same one
    any_of(
        r"""number|count|colou?rs?|sizes?|lengths?|orientation|each|every
        almost|nearly|partly|partially|roughly|(?<!most\s)similar
        anzahl|farbe|nombre|couleur|número|color""",
        "数|颜色",
    )
)
BREAK = compiled(  # between the clause of a letter and the next one
    r"[,;()—–]|\s-\s|"
    + any_of(
        """and|but|because|since|as|while|whereas|where|which|with|over|rather|instead|for|due|based
        so|then|thus|hence|therefore
        und|aber|weil|da|denn|et|parce|car|y|porque|ya|pero""",
        "因为|因為|因|而|但",
    )
)
LEAD_IN = compiled(r"(?:[^\W\d_]+[\s'-]*){1,6},\s*")  # "As far as I can tell, "
IN_DOUBT = compiled(r"\W*(?:(?:and|or|maybe|perhaps|possibly|probably)\W*)+|\s+|\s*,\s*")
FILLER = compiled(
    rf"{NOUN}|{any_of('only|just|definitely|clearly|sure|yes|hmm|ok|okay|final|both|either')}|[\W_]"
)
# Negations that deny nothing.
_MIRROR = r"""(?:mirror\w*(?: (?:images?|versions?))?|reflect\w*|flipped|inverted|differen(?:t|ces?)
|wrong|gespiegelt|spiegelbild\w*)""".replace("\n", "")
HARMLESS = compiled(
    any_of(
        rf"""(?:there(?:'s| is) )?(?:no|without(?: a| any)?|not? in) (?:doubt|question)
        not? (?:hard|difficult)|not only|none other than|nothing but
        (?:not|n't|no|nicht|kein\w*|pas|sin) (?:a |the |an |its |any |une? |ein\w* )?{_MIRROR}
        (?:i(?:'m| am) )?not (?:\w+ )?(?:sure|certain)|can(?:not|'t) be (?:\w+ )?(?:sure|certain)
        ohne zweifel|sans (?:aucun )?doute|sin duda""",
        "毫无疑问|无疑",
    )
)
REFUSAL = compiled(
    any_of(
        r"""i(?:'m| am) (?:\w+ )?(?:sorry|unable|not able)|i (?:must )?(?:refuse|decline)
        unable to (?:see|view|determine|help|answer|process|identify|assist)
        no images? (?:was|were|is|are|has|have|provided|attached)|as an? (?:ai|language)
        without the images? provided|désolée?|lo siento|no puedo|es tut mir leid
        (?:don't|do not) (?:see|have) (?:any |an |the )?(?:image|picture|ability|access)
        ich kann (?:\w+ ){0,4}?(?:nicht|kein\w*)|je (?:suis désolée?|ne peux pas)""",
        "抱歉|对不起|對不起|无法|無法|不能(?:看|回答|协助|提供)|申し訳|すみません|ごめん|できません"
        "|お答えでき|죄송",
    )
    + r"|(?:\bi|^)\s*(?:can\s*not|can't|won't|could\s*n't|am\s+not\s+going\s+to)\s+"
    r"(?!be\s+(?:\w+\s+)?(?:sure|certain)|say\s+for|choose|pick|select)|^\W*sorry\b"
)
