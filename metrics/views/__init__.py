"""What people look at: tables, charts, pages, comparisons and leaderboards of score files.

`score_tables` makes the tables of one score file and `report` its page; `protocols` shows it under
each protocol, and `compare` and `leaderboard` show several files. All tables go through `table`,
all pages through `page`, all charts through `figures`. `paper` has the figures of the paper,
`pictures` and `examples` the images of a page.
"""
