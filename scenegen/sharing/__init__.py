"""What others need to use our files: rows in formats of machine learning, and data cards.

`export` writes the rows of a file as Parquet or WebDataset, each value as it is stored, pictures as
sRGB. `card` writes a data card: a page for people, `croissant` for programs, and an `index` with a
line for each row, without pixels. These know neither rooms nor questions: a `task.Task` tells them
columns, what to count, and texts. There are two, `rooms.ROOMS` and that of `iqtt.sharing`. Only
here are pyarrow, `datasets` and mlcroissant imported.
"""
