"""The quiz: people answer mental-rotation questions on pages that this machine serves.

Start with `study`, which says what is asked and encodes its images; `draw` deals each participant
questions. `schema` is the layout of the SQLite file of answers, `sessions` what happens to it,
`commits` the thread that does it, and `answers` reads it and writes CSV. `guards` refuses what no
honest browser sends, `app` puts pages and sessions together, and `serve` runs it.
`metrics.views.people` says what the answers tell.
"""
