"""Small meshes with known triangles, and the text of files that hold them."""

import trimesh

CORNERS = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\n"
# A pyramid with a square base, which each of the texts below describes.
PYRAMID = {(0, 1, 2, 3), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)}
OBJ = {
    "plain": CORNERS + "f 1 2 3 4\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n",
    "textured": CORNERS + "vt 0 0\nf 1/1 2/1 3/1 4/1\nf 1/1 2/1 5/1\nf 2/1 3/1 5/1\n"
    "f 3/1 4/1 5/1\nf 4/1 1/1 5/1\n",
    "normals only": CORNERS + "vn 0 0 1\nf 1//1 2//1 3//1 4//1\nf 1//1 2//1 5//1\n"
    "f 2//1 3//1 5//1\nf 3//1 4//1 5//1\nf 4//1 1//1 5//1\n",
    "no such normals": CORNERS + "f 1/9/9 2/9/9 3/9/9 4/9/9\nf 1 2 5\nf 2//8 3//8 5//8\n"
    "f 3 4 5\nf 4/ 1/ 5/\n",
    "counted back": CORNERS + "f -5 -4 -3 -2\nf -5 -4 -1\nf -4 -3 -1\nf -3 -2 -1\nf -2 -5 -1\n",
    "counted back early": "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 -1\nv 0 0 1\n"
    "f -5 -4 -1\nf -4 -3 -1\nf -3 -2 -1\nf -2 -5 -1\n",
    "before its vertices": "f 1 2 3 4\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n" + CORNERS,
    "continued": CORNERS + "f 1 2 \\\n3 \\\n 4\nf 1 2\\\n 5\nf 2 3 5\nf 3 4 5\nf 4 1 5 \\\n",
    "commented": "# v 9 9 9\n\n  # f 1 2 3\n" + CORNERS + "f 1 2 3 4 # base\nf 1 2 5\nf 2 3 5 #5\n"
    "#f 1 1 1\nf 3 4 5\nf 4 1 5\n#",
    "grouped": "o a\ng\ng empty\ns off\n"
    + CORNERS
    + "g base\nusemtl none\nf 1 2 3 4\ng\n\ng sides\n"
    "s 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\ng last\n",
    "broken materials": "mtllib /no/such/a.mtl\nmtllib C:\\models\\\nusemtl C:\\x\\\n# C:\\x\\\n"
    + CORNERS
    + "mtllib \nf 1 2 3 4\nusemtl\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n",
    "colours and weights": "v 0 0 0 1 0 0\nv 1 0 0 1.0\nv 1 1 0 0 0 0 1\nv 0 1 0 # left\nv 0 0 1\n"
    "f 1 2 3 4\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n",
    "blanks": "  v\t0 0  0 \n\tv 1 0 0\nv 1e0 +1.0 0.\nv 0 1.0E+00 -0\n v .0 0 1\t\nf\t1 2  3 4 \n"
    " f 1 2 5\nf 2 3 5\nf 3 4 5\nfo 4 1 5\n",
}
SPHERE = trimesh.creation.icosphere(subdivisions=2, radius=3.0)
