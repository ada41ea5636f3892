"""Names of basic shapes and of the built-in classes of objects."""

SHAPE_NAMES = (
    "box", "sphere", "cone", "torus", "cylinder", "teapot", "capsule", "pyramid", "prism",
    "tetrahedron", "octahedron", "dodecahedron", "icosahedron",
)  # fmt: skip
FAMILY_NAMES = ("bag", "bottle", "bowl", "can", "cap", "chair", "lamp", "mug", "table")
FURNITURE_NAMES = (  # families that came with closed rooms
    "armchair", "basket", "bed", "book", "books", "box", "cabinet", "clock", "coffee_table", "cup",
    "curtain", "cushion", "desk", "floor_lamp", "nightstand", "pendant", "picture", "plant",
    "plate", "rug", "screen", "shelf", "sofa", "stool", "tall_plant", "vase",
)  # fmt: skip
