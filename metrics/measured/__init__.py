"""Truth that others measured: the file of it, and the protocols by which it is scored.

`layout` has the format, `reader` and `writer` are its two ends, and `protocols` is the table of
rules by which the field takes numbers of one prediction. Imports the folders below it
(`metrics.measures`) and the file layer of rooms.
"""
