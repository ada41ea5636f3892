"""Scoring: from submissions and their truth to scores with intervals.

`evaluate.score` is the entry: it opens the submissions and calls `rooms` or `questions`, which
share `runs`. `rows` scores each row, `image_scores` computes all scores of one image, and
`estimates` makes means, groups and skills of them. `records` are the scores as data, `metric_names`
is the table of all scores with units and definitions, and `schema` and `tables` check a score file
that is read.

Imports `metrics.measures`, `metrics.submissions`, and the readers of rooms and questions; never a
renderer.
"""
