"""Scenes in 3D, in the browser: what `scenegen view` and `bench view` show.

`geometry` has what is drawn as plain arrays: surfels, meshes, and which surfel a click hits.
`contents` says what a page shows of a file of rooms; that of predictions is in `metrics.viewing`.
`server` starts and ends the web server, `drawing` puts arrays on it, and `page` joins scenes and
controls; only these three know viser, which is imported when they are called.

It may import everything in `scenegen` but the commands and `sharing`. Start reading in `page`.
"""
