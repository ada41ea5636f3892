"""From images to items: `rows` scores each row, `image_scores` computes all scores of one image.

`layers` scores predictions of layers and meshes, `panoramas` those of equirectangular images, and
`measured_rows` those with sensor ground truth. `geometry` is what the scores of a row share.
"""
