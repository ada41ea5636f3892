"""Scores of one submission for people: text and Markdown, CSV, and a self-contained page.

`text` makes the tables that all formats share. `page` puts the `headline` first, beside floors, the
`paper_tables` and other methods; then `scenes` or `questions` with `pictures`, `curves` and other
`charts` on their `axes`. `at_hand` finds the files that a score file names. `html` fills the pages
in `templates/`; those of comparisons and the leaderboard are there, too, with one base and style.

These modules import `metrics.scoring` for the scores, `metrics.submissions` and `scenegen.rooms`
for the pictures. Start reading in `text`.
"""
