"""Files of questions: their layout, and how they are written, read, described and drawn.

Start with `layout`, the schema, and `split`, the files of a split. `reader` is what users read
with, `make` makes the files of a split and `work` their rows, `info` describes a file and `preview`
draws its questions. `scenegen.rooms` has the same modules for files of rooms.
`iqtt.render`, `iqtt.questions`, `iqtt.shapes` and `scenegen` may be imported here.
"""
