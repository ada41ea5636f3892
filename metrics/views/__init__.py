"""Scores for people: every command's output, drawn from score files.

A `table` prints as text, Markdown, LaTeX and HTML. A `page` is made of sections, each with tables,
`plots` and `examples`. On them stand the views: the `report` of one score file (`score_tables`,
`headline`, `by_angle`), the comparison of several in `compare`, the ranking of all in
`leaderboard`, and what people answered in `people`. `paper` has the figures that the paper reports.

Start reading in `table`, then `report`.
"""
