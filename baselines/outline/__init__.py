"""What outlines tell without any 3D: the floor that a model of shapes has to beat on questions.

`submission` writes the answers of two rules that see silhouettes alone: the answer whose outline
lies best on the reference's, and gradient-boosted trees on features of outlines that learn from
labelled questions. Neither needs torch.
"""
