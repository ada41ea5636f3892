"""Limits on the size of mesh files, so that no file can use up memory or time.

`BadMeshError` refuses a model beyond them. Modules read these values at every use, through the
module, so that tests can lower them.
"""

MOST_BYTES = 256 * 2**20  # in a file
MOST_FACES = 2_000_000  # triangles of a model
MOST_CORNERS = 8_000_000  # vertices, or corners of all polygons, in a text file
MOST_EAR_CLIPPING = 1e10  # sum of squared corner counts of the polygons to be clipped; some 20 s
MOST_NODES = 100_000  # of a GLB file's scene
MOST_HEADER_BYTES = 1 << 16  # of a PLY file
