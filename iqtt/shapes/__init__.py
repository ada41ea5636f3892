"""Shapes made of unit cubes: when two are the same, how they are made, and which split has them.

Start with `polycube`: when two shapes are the same, mirror images, symmetries, size.
`chains_and_trees` grows and lists shapes, `near` moves one cube of a shape, and `splits` decides
which shapes belong to training, validation and test. All is integer arithmetic, exact on every
machine; nothing else of `iqtt` is imported here. The audit must not import this folder.
"""
