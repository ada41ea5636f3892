"""The `scenegen` commands: on files of rooms, on data cards (`sharing`), and on mesh folders.

Only here and in `scenegen.command_line` is click imported. A command parses its options, makes one
library call and prints the result.
"""
