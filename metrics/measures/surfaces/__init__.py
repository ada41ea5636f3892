"""Predicted points, surfaces and normals against the true ones.

`chamfer_hausdorff` holds the distances between sets of points, `image_search` finds the nearest of
them quickly between two depth images, and `patches` measures the distances between the surfaces
that they lie on. `points` compares points of the same pixels, and `normals` directions.
"""
