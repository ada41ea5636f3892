"""Readers of mesh files, one format each: GLB, OBJ, OFF, PLY, STL.

A reader takes the bytes of a file and returns vertices, (V, 3), and triangles, (F, 3), or raises
`BadMeshError`. It opens no other file, and its time and memory are bounded by `limits`. There may
be NaN, infinity and triangles out of range: `clean` drops and counts those. `text` and `polygons`
are shared helpers. `scenegen.objects.meshes.read` chooses the reader by the file's suffix.

The readers are ours because trimesh 5.2 read five of six files that users had brought wrongly,
three of them as nothing without a word: binary STL files whose count or first word misleads, and a
text PLY file with lists over several lines. It placed an instanced GLB mesh once, and passed over a
required extension that it does not know.
"""
