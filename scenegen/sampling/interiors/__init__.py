"""Closed rooms with furniture: drawn one after another, by rules of what stands where.

- `rooms` draws what stays with an item: size, windows, door, light and the number of objects.
- `spaces` holds what is taken: boxes about objects, and the surfaces on which things stand.
- `arranging` puts furniture where it belongs, `small_things` what stands on it, and `recipes` says
  what a room is furnished with; `viewpoints` places the cameras.
- `scenes` joins them to `SceneArrays`. Start with `scenes`.
"""
