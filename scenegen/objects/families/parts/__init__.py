"""Geometry that several families of objects share.

`profiles` are plane curves; `surfaces` turns and lofts them into closed parts, `sweeps` moves a
cross-section along them, `walls` gives them a thickness, `boxes` are flat-sided. `moves` turns and
shifts parts, `draws` draws random proportions, `assembly` joins parts into a unit shape. Start with
`surfaces.loft`. Besides each other these files import only `scenegen.objects.solids`.
"""
