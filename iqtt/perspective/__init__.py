"""Questions about furnished rooms: which image shows the same room, seen from elsewhere?

`specs` has the settings, `rooms` draws scenes and renders their images, `columns` lays out what is
stored. `scenegen.sampling.interiors.alternatives` arranges the furniture.
"""
