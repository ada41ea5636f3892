"""Score files side by side in ranked tables, with the figures that the paper reports.

`ranking` decides which tables there are and in which order methods stand, `table` builds one of
them, and `text` writes Markdown, HTML or LaTeX. `site` makes a folder of pages, with `paired_tests`
against the first method and a `gallery`.

These modules import `metrics.scoring` for the scores, `metrics.comparison` for the tests, and
`metrics.report` for cells, pages and the paper's figures.
Start reading in `ranking`.
"""
