"""The records of basic shapes, beside what the docs and files say."""

from pathlib import Path

from scenegen.description.names import DRAWN_SHAPES
from scenegen.description.shapes import BASIC_SHAPES

DOCS = Path(__file__).parents[3] / "docs" / "objects.md"


def test_the_docs_have_a_row_for_each_record():
    rows = [f"| {shape.name} | {shape.proportions} |" for shape in BASIC_SHAPES]
    assert "\n".join(["| --- | --- |", *rows, ""]) in DOCS.read_text()


def test_what_data_sets_draw_by_default_never_changes():
    assert DRAWN_SHAPES == (
        "box", "sphere", "cone", "torus", "cylinder", "teapot", "capsule", "pyramid", "prism",
        "tetrahedron", "octahedron", "dodecahedron", "icosahedron",
    )  # fmt: skip
