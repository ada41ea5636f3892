"""The `scenegen` commands: `rooms` has those on files of rooms, `meshes` the one on mesh folders.

Only here and in `common.command_line` is click imported. A command parses its options, makes one
library call and prints the result.
"""
