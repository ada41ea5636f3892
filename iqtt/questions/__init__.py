"""Questions before they are rendered: settings, shapes, views, and batches for the renderer.

Start with `specs`, the settings of a split. `distractors` draws the three answers of a question and
which of them is right; `views` finds rotations under which every cube shows, and lights; `packing`
turns questions into batches for `scenegen.rendering`. `iqtt.shapes` and `scenegen` may be imported
here. `iqtt.render` makes the images.
"""
