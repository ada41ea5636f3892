"""Scoring: from submissions and their truth to scores with intervals.

`evaluate.score` is the entry: it opens the submissions and calls `rooms` or `questions`, which
share `runs`. `images` scores each image. `records` are the items as data; `estimates` makes means,
intervals, groups and skills of them when these are asked for. `metric_names` is the table of all
scores with units and definitions.

Imports `metrics.measures`, `metrics.submissions`, and the readers of rooms and questions; never a
renderer.
"""
