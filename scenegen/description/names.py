"""Names of basic shapes and of the built-in classes of objects."""

from scenegen.description.shapes import BASIC_SHAPES

SHAPE_NAMES = tuple(shape.name for shape in BASIC_SHAPES)
DRAWN_SHAPES = tuple(shape.name for shape in BASIC_SHAPES if shape.drawn)  # by default
FAMILY_NAMES = ("bag", "bottle", "bowl", "can", "cap", "chair", "lamp", "mug", "table")
FURNITURE_NAMES = (  # families that came with closed rooms
    "armchair", "basket", "bed", "book", "books", "box", "cabinet", "clock", "coffee_table", "cup",
    "curtain", "cushion", "desk", "floor_lamp", "nightstand", "pendant", "picture", "plant",
    "plate", "rug", "screen", "shelf", "sofa", "stool", "tall_plant", "vase",
)  # fmt: skip
