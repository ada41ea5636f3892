"""What a model is asked: words, and the sizes of pictures."""

from iqtt.vlm.reading import LETTERS

SMALLEST, SIZE, LARGEST = 64, 512, 1024  # pixels of a picture's shorter side
RULE = (
    "Each shape is made of unit cubes that touch face to face. Every cube of a shape shows in every"
    " picture of it. One of the answers shows the same shape as the reference, turned in space. The"
    " other answers show other shapes, and these may be the mirror image of the reference."
)
ASK = "Which answer shows the same shape as the reference?"
ROOMS_RULE = (
    "Each picture shows a furnished room. One of the answers shows the same room as the reference,"
    " seen from another place. The other answers differ from it in where some furniture is or in"
    " what direction it faces. All answers are seen from one place."
)
ROOMS_ASK = "Which answer shows the same room as the reference?"
# Not a sentence to be learned: whoever trains on text with this mark has trained on test data.
CANARY = "pix2shape-bench:canary:5b0c1e0a-6f0e-4c39-9a7d-2f4f0d9c7e61"


def letters(answers: int) -> str:
    """Return "A, B or C" for three answers."""
    return f"{', '.join(LETTERS[: answers - 1])} or {LETTERS[answers - 1]}"


def question_text(
    answers: int, layout: str = "composed", with_reference: bool = True, of_rooms: bool = False
) -> str:
    """Return the question.

    Args:
        answers: how many there are, 2 or 3.
        layout: "composed" for one picture of all, or "separate" for one picture each.
        with_reference: False asks without the reference, for a control.
        of_rooms: whether it is about furnished rooms, not shapes.
    """
    rule, ask = (ROOMS_RULE, ROOMS_ASK) if of_rooms else (RULE, ASK)
    names = ", ".join(LETTERS[:answers])
    if layout == "separate":
        shown = f"The first picture is the reference. The next {answers} pictures are {names}."
        shown = shown if with_reference else f"The {answers} pictures are {names}."
    else:
        shown = f"The picture shows the reference above, and the answers {names} below."
        shown = shown if with_reference else f"The picture shows the answers {names}."
    hidden = "" if with_reference else " The reference is not shown to you: guess."
    return f"{shown}{hidden} {rule}\n\n{ask} Answer with one letter: {letters(answers)}."
