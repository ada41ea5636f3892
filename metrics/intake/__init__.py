"""Doors for models of any kind: their outputs become submissions.

`outputs` turns what a model returns, or a file holds, into the geometry of the submission format;
`resampling` brings it to the size of the truth. `running` calls a model of the user's
(`model_file`) on every row and keeps what is done (`kept_rows`). Folders of files have one reader,
for predictions (`importing`) and for truth (`truth_files`): `folders` says which file belongs to
which row, `array_files` reads it, and `reading` takes its numbers. `answers` has the doors for
answers to questions. Start reading with `outputs`.

Imports `metrics.submissions` and what it imports; never torch.
"""
