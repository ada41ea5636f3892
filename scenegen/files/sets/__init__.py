"""Sets: many rows become files, or shards of one file, on one machine or many.

`plan` says what the files hold, and `making` makes those that are missing, in `workers` or on a
`cluster`. `sets` writes the files and merges shards, `shards` shows a set as one file.
`workspace`: the hidden folder where a file is until it is complete.
"""
