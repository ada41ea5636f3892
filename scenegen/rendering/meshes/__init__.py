"""Triangle meshes on the device: `rasteriser` finds what camera rays meet first.

`unit_scene` and `model_scene` hold basic shapes and models in Mitsuba scenes, for other rays.
"""
