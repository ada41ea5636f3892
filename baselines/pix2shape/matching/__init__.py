"""Relief of rooms by matching several images of a scene, which training may take for the truth.

    search.py  relief by search: a plane sweep and semi-global matching; nothing is learned
    relief.py  relief of whole files, kept in the folder of a run

Neither depth, normals nor ids are read.
"""
