"""The records of basic shapes, beside what the docs and files say."""

from scenegen.description.names import DRAWN_SHAPES


def test_what_data_sets_draw_by_default_never_changes():
    assert DRAWN_SHAPES == (
        "box", "sphere", "cone", "torus", "cylinder", "teapot", "capsule", "pyramid", "prism",
        "tetrahedron", "octahedron", "dodecahedron", "icosahedron",
    )  # fmt: skip
