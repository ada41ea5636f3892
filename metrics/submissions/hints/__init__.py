"""Hints on known mistakes in submissions, such as distance along the ray instead of depth.

A hint is given only where undoing the mistake explains the predictions, measured against the
truth: in most of the sampled images the error falls to half of what any simple remedy (a scale, a
shift) leaves, and to half of what a constant would score. Good, middling, constant and random
predictions do not get there. A hint never makes a submission invalid.

`tasks` gathers the hints for the two tasks: start reading there. `depth`, `points`,
`normals` (with the `frames` that these two may be in), `no_value` and `order` have the mistakes,
`samples` reads the images that they look at. Imports the folder above it (`metrics.submissions`),
`metrics.measures` and the reader of rooms.
"""
