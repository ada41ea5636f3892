"""Draws scenes at random: (`DatasetSpec`, item indices, attempts) -> `SceneArrays`.

All randomness of rooms ends here; what follows is deterministic. Everything is drawn for many items
at once. `proposals` keeps a stock of what `scenes` puts together from the other files: `cameras`,
`lights`, `objects` (which ones, of which material), `poses` (how they are turned) and `placement`
(where they stand), which ask `bodies` how far shapes reach.

It imports `objects`, `description`, `camera` and `common`. Start with `scenes`.
"""
