"""Scores of one submission for people: text and Markdown, CSV, and a self-contained page.

`text` makes the tables that all formats share, and `page` adds `charts` and `pictures` to them.
`html` fills the pages in `templates/`; those of the leaderboard are there, too, and all have one
base and one style.

These modules import `metrics.scoring` for the scores, `metrics.submissions` and `scenegen.rooms`
for the pictures. Start reading in `text`.
"""
