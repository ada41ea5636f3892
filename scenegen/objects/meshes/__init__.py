"""Meshes from files: folders of models listed, read, cleaned, cached, and turned into unit shapes.

The files come from strangers, so every size is bounded (`limits`) and a model that cannot be used
is refused with a reason (`errors.BadMeshError`).

- `listing`, `folders` and `shapenet` find out which models there are, without opening them.
- `read`, with one file format each in `readers`, gives vertices and triangles.
- `clean` mends and normalises these, `hull` computes a convex body for placement.
- `appearance` gives faces their colours and textures.
- `models` does all that to one file and keeps the result on disk, `store` makes unit shapes of it.
- `check` tries every model of a folder, for `scenegen check-objects`.

Start with `folders.open_models` and `store.MeshStore`.
"""
