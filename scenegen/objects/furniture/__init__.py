"""What closed rooms hold, in metres, with texture coordinates and kinds of materials.

- `furnishing` makes a family's member to furniture; `unwrapping` lays materials on it.
- `shapes` puts furniture in the place of unit shapes, and tells what placing needs of it.
- `room_shell` makes the room itself.
"""
