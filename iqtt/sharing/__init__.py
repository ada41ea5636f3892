"""What others need to use files of questions: rows in formats of machine learning, and data cards.

`published` says which files of a split are handed out, and refuses any that would tell the answers
of test questions. `index` and `describe` are what a data card tells of them, `make` writes it, and
`export` writes rows. How pages, metadata and tables are written is in `scenegen.sharing`.

It may import everything in `iqtt` but the commands and the audit.
"""
