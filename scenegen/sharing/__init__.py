"""What others need to use our files: rows in formats of machine learning, and data cards.

`export` writes the rows of a file as Parquet or WebDataset, each value as it is stored, pictures as
sRGB. `index`
writes a line for each row, without pixels, and `card` a page for people with metadata for programs.
These know neither rooms nor questions: `rooms` and `iqtt.sharing` tell them columns, what to count,
and texts. Only here are pyarrow, `datasets` and mlcroissant imported.
"""
