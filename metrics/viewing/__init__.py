"""Predictions of rooms in 3D, in the browser: what `bench view` shows.

`order` puts scenes in the order of a score, the worst first; `colors` makes colours of errors; and
`page` puts predicted surfels beside the true ones, on a page of `scenegen.viewing`, which has the
web server and all that knows viser.

Start reading in `page`.
"""
