"""Submissions: the files through which any model meets the benchmark.

`layout` is the format as tables, `reader` opens a submission, `writer` makes one, `validation`
lists everything that is wrong with one. `inspection` checks an HDF5 submission without its truth,
`answers_json` reads answers in JSON, `missing_rows` holds a submission against its truth, `rules`
are the conditions on values that readers and writers share, and `problems` is how all of them say
what is wrong. Hints on known mistakes are in `hints`. Start reading with `layout`.

Imports `metrics.measures`, the readers of rooms and questions, and `scenegen.common`; never a
renderer. `strict_json` and `answers_json` import pydantic: import them only where JSON is read.
"""
