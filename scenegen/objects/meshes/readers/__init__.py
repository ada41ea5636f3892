"""Readers of mesh files, one format each: GLB, OBJ, OFF, PLY, STL.

A reader takes the bytes of a file and returns vertices, (V, 3), and triangles, (F, 3), or raises
`BadMeshError`. It opens no other file, and its time and memory are bounded by `limits`. There may
be NaN, infinity and triangles out of range: `clean` drops and counts those. `text` and `polygons`
are shared helpers. `scenegen.objects.meshes.read` chooses the reader by the file's suffix.
"""
