"""What a data set and a scene are, as frozen records: no randomness, no pixels, no files.

`DatasetSpec` (`specs`) is the request for a data set, `SceneSpec` (`scenes`) describes one scene of
it in full, and `presets` are the paper's data sets as requests.

It imports `common` and `camera`. Start with `scenes`.
"""
