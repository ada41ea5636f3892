"""Score files side by side in ranked tables, with the figures that the paper reports.

`paper_tables` holds the paper's figures, `ranking` decides which tables there are and in which
order methods stand, `table` builds one of them, and `text` writes Markdown, HTML or LaTeX.
`names` refuses names that could be taken for others, and `recheck` numbers that do not follow from
the scores of the items.

These modules import `metrics.scoring` for the scores and `metrics.report` for cells and pages.
Start reading in `ranking`.
"""
