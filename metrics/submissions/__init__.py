"""Submissions: the files through which any model meets the benchmark.

`layout` is the format as tables, and `rules` are the conditions on types, shapes and values that
writers, the reader, scoring and `validate` share. `reader` opens a submission, which `inspection`
checks without its truth (`answers_json` reads answers in JSON); `truths` finds the truth and holds
the submission against it. `writer` makes a submission, `validation` lists everything that is wrong
with one, `problems` is how all of them say so. Hints on known mistakes are in `hints`. Start
reading with `layout`.

Imports `metrics.measures`, the readers of rooms and questions, and `scenegen.common`; never a
renderer. `strict_json` and `answers_json` import pydantic: import them only where JSON is read.
"""
