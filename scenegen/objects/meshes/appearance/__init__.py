"""How meshes look: `materials` and `textures` of a file, and the `colors` of its faces."""
