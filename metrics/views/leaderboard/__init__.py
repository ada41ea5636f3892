"""Score files side by side in ranked tables, with the figures that the paper reports.

`ranking` decides which tables there are and in which order methods stand. `rows` fills them, and
`floors` has those that are no methods. `site` makes a folder of pages, with paired tests against
the first method and a `gallery`.

Start reading in `ranking`.
"""
