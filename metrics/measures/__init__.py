"""The scores themselves: functions that take arrays and return numbers.

`chamfer_hausdorff` holds the point-cloud distances, and `image_search` finds nearest neighbours
between two depth images quickly; `depth` and `normals` compare maps, `objects` and `relief` look at
what stands before the `empty_room`, `answers` counts right answers to questions, `statistics` gives
confidence intervals, and `skill` sets a score against that of a floor. Every function refuses bad
input by the errors of `checks`.

Nothing here reads a file. Of the project, these modules import only `scenegen.camera` and
`scenegen.common`. Start reading in `chamfer_hausdorff`.
"""
