"""Files of rows: one layer under rooms, questions and predictions, which knows none of them.

Reading: `input_file` opens what anyone may have written, `shards` shows a set as one file, `rows`
reads columns of a `schema`, `verify` checks them. Writing: `table` writes columns, `plan` says what
a set of files holds, `sets` writes its files, and `making` makes those that are missing, with
`workers` or a `cluster`. `new_file` and `workspace`: outputs appear when complete.
"""
