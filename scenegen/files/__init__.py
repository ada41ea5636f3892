"""Files of rows: one layer under rooms, questions and predictions, which knows none of them.

Reading: `input_file` opens what anyone may have written, `rows` reads columns of a `schema`, and
`verify` checks them. Writing: `table` writes columns, and an output of `new_file` appears when it
is complete. `sets` makes files of many rows, with worker processes of `pool`. `images` reads and
writes image files.
"""
