"""The path-traced variant of the colour (`--shading path`): shadows and light that bounces.

`path_tracer` makes the images, by Mitsuba; `phong_material` is the material of their surfaces.
Depth, normals and ids are those of the other renderers. Start with `path_tracer`.
"""
