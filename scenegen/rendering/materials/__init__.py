"""What surfaces look like: maps of colour, roughness and height, drawn or read from a folder.

`material` makes a material of a kind from a stream of random numbers and a palette. `palettes` are
colours that people put together, `fields` are tileable noise, `patterns` draw one kind each, and
`folders` read maps that others made. None of these files needs Mitsuba.
"""
