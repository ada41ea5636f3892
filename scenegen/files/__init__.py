"""Files of rows: one layer under rooms, questions and predictions, which knows none of them.

`row_file` writes tables of rows, whose axes `axes` names, and `content` digests. `input_file` opens
files and reads arrays, after `trial` has tried a file in another process; `attributes` reads texts.
`making` and `manifest` make sets of shards, `pool` and `cluster` spread the work.
"""
