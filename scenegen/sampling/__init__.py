"""Draws scenes at random: (`DatasetSpec`, item indices, attempts) -> `SceneArrays`.

All randomness of rooms ends here; what follows is deterministic. Everything is drawn for many items
at once.

- `scenes` proposes scenes; `proposals` keeps a stock of them until each item has an accepted one.
- `cameras` and `lights` draw positions on an `octant` around the target.
- `objects` draws classes, models and materials, `poses` orientations, `placement` free places.
- `bodies` tells how far shapes reach.

It imports `objects`, `description`, `camera` and `common`. Start with `scenes`.
"""
