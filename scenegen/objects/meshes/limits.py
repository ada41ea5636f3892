"""How much of a model is taken, so that no file can take the memory or the day."""

MOST_BYTES = 256 * 2**20  # of a file
MOST_FACES = 2_000_000  # triangles of a model
MOST_CORNERS = 8_000_000  # of all polygons of a file
