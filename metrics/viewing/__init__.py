"""Predictions of rooms in 3D, in the browser: what `bench view` shows.

`order` puts scenes in the order of a score, the worst first, and `page` puts predicted surfels
beside the true ones, on a page of `scenegen.viewing`. Start reading in `page`.
"""
