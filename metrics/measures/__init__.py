"""The scores themselves: functions that take arrays and return numbers.

`chamfer_hausdorff` holds the point-cloud distances, and `image_search` finds nearest neighbours
between two depth images quickly; `depth` and `normals` compare maps, `answers` counts right answers
to questions, and `statistics` gives confidence intervals. Every function refuses bad input by the
errors of `checks`.

Nothing here reads a file. Of the project, these modules import only `scenegen.camera` and
`scenegen.common`. Start reading in `chamfer_hausdorff`.
"""
