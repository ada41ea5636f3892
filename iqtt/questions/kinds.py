"""The kinds of questions, and what their wrong options are to the reference."""

from collections.abc import Sequence
from dataclasses import dataclass

# What a wrong option is to the reference; "near-mirror" mirrors a "near" shape. Files name those of
# their time, so this is append only: readers take every beginning of it.
DISTRACTOR_KINDS = (
    *("other", "near", "mirror", "matched", "near-mirror"),
    *("moved", "turned"),  # of furnished rooms
)
OF_CUBES = DISTRACTOR_KINDS[:5]


@dataclass(frozen=True)
class QuestionKind:
    """A kind of questions.

    Attributes:
        meaning: what its wrong options show.
        options: numbers of options that it can have.
        mixed: whether `mixed` draws it. Kinds that come later are not drawn, so that the questions
            of earlier requests stay.
    """

    meaning: str
    options: tuple[int, ...] = (2, 3)
    mixed: bool = True


QUESTION_KINDS = {  # `mixed` draws from them in this order
    "other": QuestionKind("different shapes"),
    "near": QuestionKind("the same shape with one cube moved"),
    # With two options a `mirror` question would be a `mirror-pair` question.
    "mirror": QuestionKind("the mirror image, and a shape with one cube moved", options=(3,)),
    "matched": QuestionKind("different shapes with similar silhouettes"),
    "mirror-pair": QuestionKind("only the mirror image"),
}
ROOM_KINDS = {  # of furnished rooms
    "moved": QuestionKind("the same room with one object at another place", options=(3,)),
    "turned": QuestionKind("the same room with one object turned", options=(3,)),
}
DISTRACTORS = (*QUESTION_KINDS, "mixed")  # what `--distractors` takes


def question_kind(kinds: Sequence[int]) -> str:
    """Return the kind of a question by the kinds of its answers, such as "mirror-pair" or "near-2".

    Args:
        kinds: of each answer, -1 for the right one, else an index into DISTRACTOR_KINDS, as the
            dataset `distractor_kind` has them.

    Raises IndexError for an unknown kind, ValueError where no answer is wrong.
    """
    wrong = sorted({DISTRACTOR_KINDS[kind] for kind in kinds if kind >= 0})
    if not wrong:
        raise ValueError("a question has a wrong option")
    kind = "mirror" if {"mirror", "near-mirror"} & set(wrong) else wrong[0]
    if wrong == ["mirror"]:
        kind = "mirror-pair"
    return kind if len(kinds) == 3 else f"{kind}-{len(kinds)}"
