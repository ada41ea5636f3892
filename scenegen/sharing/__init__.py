"""What others need to use our files: rows in formats of machine learning, and data cards.

`export` writes the rows of a file of rooms as Parquet or as WebDataset, each value as it is stored.
`make` writes a data card: a page for people, Croissant metadata for programs, and a Parquet index
of all rows. What is written to (`folder`, `index_file`) and the `description`, from which the page
and the metadata are written, know nothing of rooms, so that `iqtt.sharing` uses them too.

It may import everything in `scenegen` but the commands. Only here is pyarrow imported. Start with
`folder` and `export`, then read `description` and `make`.
"""
