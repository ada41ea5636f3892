"""The scores themselves: functions that take arrays and return numbers.

`surfaces` holds distances between points and between surfaces, and the errors of normals; `depth`
compares depth maps after an `alignment`, and `boundaries` their jumps; `objects`, `shape`, `relief`
(with the empty room) look at objects, and `hidden` at what an image does not show; `answers` reads
answers to questions, `statistics` gives confidence intervals, and `skill` sets a score against that
of a baseline. Every function refuses bad input by the errors of `checks`.

Nothing here reads a file. Of the project, these modules import only `scenegen.camera` and
`scenegen.common`. Start reading in `surfaces.chamfer_hausdorff`.
"""
