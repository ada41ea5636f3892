"""What others need to use our files: rows in formats of machine learning, and a data card.

`export` writes the rows of a file as Parquet or WebDataset, each value as it is stored, pictures as
sRGB. `card` writes a page of files that are handed on, from one template. Both know neither rooms
nor questions: a `task.Task` tells them columns and values, a template of its own what a card says.
Only here are pyarrow, `datasets` and huggingface_hub imported.
"""
