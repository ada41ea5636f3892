"""Relief of rooms by matching several images of a scene, which training may take for the truth.

    reprojection.py  what another image shows at the points that an image sees
    search.py        relief by search: a plane sweep and semi-global matching; nothing is learned
    labels.py        relief of a whole file

Neither depth, normals nor ids are read.
"""
