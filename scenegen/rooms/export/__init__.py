"""Rows of a file of rooms in the formats of other tools.

`formats` has a record of each format. `encoding` says how values become the whole numbers of
pictures. `single` writes one row to files of its own: EXR, PNG, PLY, and OBJ by `obj`. `folder`
writes many rows to the folder that a tool reads, with one module for each format: `nerfstudio`,
`colmap`, `bop`, `coco`, `moge`, `stereo`, and `glb`, which writes scenes by `gltf`.

Start with `formats`, then `single` and `folder`.
"""
