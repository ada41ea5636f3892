"""Rooms in 3D, in the browser: what `scenegen view` and `bench view` show.

`geometry` makes plain arrays of a room: surfels, their colours, meshes, and what a click hits.
`page` draws them on a `server` of viser by `drawing`, with the controls beside, and predictions
where there are any. Start reading in `page`.
"""
