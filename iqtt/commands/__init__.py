"""The `iqtt` commands: on files of questions, and those that hand them on (`sharing`).

Only here is click imported. A command parses its options, makes one library call and prints.
"""
