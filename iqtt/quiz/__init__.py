"""The quiz: people answer mental-rotation questions on pages that this machine serves.

Start with `study`, which says what is asked; `draw` deals each participant questions, and
`pictures` encodes their images. `schema` is the layout of the SQLite file of answers, `sessions`
what happens to it, `commits` the thread that does it, and `export` writes CSV. `pages` fills the
templates; `guards` refuses what no honest browser sends, `app` puts pages and sessions together,
and `serve` runs it. `metrics.views.people` says what the answers tell.
"""
