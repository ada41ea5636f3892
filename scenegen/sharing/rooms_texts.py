"""What a data card says of rooms in general: use, limits, biases, reading."""

KEYWORDS = (
    "synthetic", "3d", "depth-estimation", "surface-normals", "single-image-3d",
    "inverse-graphics", "ground-truth", "pix2shape-bench",
)  # fmt: skip
SUMMARY = (
    "Synthetic images of a room's corner that holds a few objects, rendered by a program, with the"
    " exact ground truth of each pixel (depth, surface normal, object id) and of each scene"
    " (camera, lights, materials, objects and their poses)."
)
READING = """The HDF5 files are read by any HDF5 library. In Python:

    import h5py

    with h5py.File(name) as f:
        depth = f["depth"][row]  # (H, W) float32, planar, scene units
        radiance = f["image"][row] * f["image"].attrs["scale"]  # (H, W, 3) linear RGB

`datasets.load_dataset(folder, "index")` reads the index, and so does `mlcroissant` by
`croissant.json`. Lengths are in scene units: the room's edge is 1. World frame: right-handed, y up,
the floor at y = 0, walls at x = 0 and z = 0. Camera frame: x right, y up, looks along -z. Images
are linear: no gamma is applied."""
RESPONSIBLE: dict[str, str | list[str]] = {
    "data_collection": "Nothing was collected. Scenes are drawn by a program from a specification"
    " and a seed, and rendered by ray casting; the ground truth is what the rays hit. The page"
    " README.md has the commands and all settings.",
    "data_collection_missing_data": "Depth is NaN, the normal zero and the object id -1 where a"
    " pixel's ray meets nothing. Nothing else is missing and nothing is filled in.",
    "data_preprocessing_protocol": [
        "None: values are stored as they were rendered. Images of 8 bits are linear radiance from"
        " 0 to 1, clipped and rounded to 255 steps."
    ],
    "data_annotation_protocol": [
        "No person labelled anything. Depth, normals and object ids are computed for the one ray"
        " through each pixel's centre, from the same scene that gives the image."
    ],
    "data_use_cases": [
        "Training and testing methods that estimate depth, normals, objects or new views from a"
        " single image, where exact ground truth is needed.",
        "Comparing such methods under one protocol, with bench score of pix2shape-bench.",
        "Not for deciding how well a method does on photographs, and not for uses that concern"
        " people: no data of this kind is in the files.",
    ],
    "data_limitations": [
        "Rooms are a floor and two walls, without texture, windows or clutter, and hold a few"
        " objects. The camera looks at a fixed point from a fixed distance.",
        "With the paper's shading equation there are no shadows and no indirect light, unless the"
        " settings say so; there is no noise of a sensor, no blur and no distortion of a lens.",
        "Depth belongs to the ray through a pixel's centre; at silhouettes it is not the mean over"
        " the pixel.",
    ],
    "data_biases": [
        "All images are synthetic, and of one kind of room. Shapes or classes are drawn with equal"
        " probability, not as often as they occur in homes.",
        "Objects that would show too few pixels, or that the border would cut, are drawn again"
        " unless the settings say otherwise; so large and central objects are favoured.",
        "The built-in everyday objects are of nine classes, in proportions that a program draws.",
    ],
    "personal_sensitive_information": [
        "None: no people, no places, no text. The recorded commands hold names of files of those"
        " who made the data."
    ],
}
