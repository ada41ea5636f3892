"""Draws scenes at random: (`DatasetSpec`, item index, attempt) -> `SceneSpec`.

All randomness of rooms ends here; what follows is deterministic. `scenes` puts together what the
other files draw: `cameras`, `lights`, `objects` (which ones, of which material), `poses` (how they
are turned) and `placement` (where they stand).

It imports `objects`, `description`, `camera` and `common`. Start with `scenes`.
"""
