"""Folders of meshes that nobody here made, turned into unit shapes.

Going down: `check` tries every model of a folder, `store` hands out shapes, `cache` keeps cleaned
models on disk, `clean` mends, `read` reads files, `folders` lists what is there.
"""
