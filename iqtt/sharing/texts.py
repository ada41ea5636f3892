"""What a data card says of mental-rotation questions in general: use, limits, biases, reading."""

KEYWORDS = (
    "synthetic", "3d", "mental-rotation", "visual-reasoning", "multiple-choice",
    "single-image-3d", "3d-iqtt", "pix2shape-bench",
)  # fmt: skip
SUMMARY = (
    "Mental-rotation questions (3D-IQTT), rendered by a program: a reference image of a shape made"
    " of cubes, and two or three answers, of which one shows the same shape from another side."
    " Every cube of a shape shows in every picture."
)
READING = """The HDF5 files are read by any HDF5 library. In Python:

    import h5py

    with h5py.File(name) as f:
        reference, *answers = f["questions"][row]  # (H, W, 3) each
        radiance = reference * f["questions"].attrs["scale"]  # linear RGB, 0 to 1

In the training file the data sets lie in the groups `labeled` and `unlabeled`, and the truth in
`truth/labeled` and `truth/unlabeled`. A file of test questions has `questions` alone.
`datasets.load_dataset(folder, "index")` reads the index, and so does `mlcroissant` by
`croissant.json`. Lengths are in cube edges. World and camera: right-handed, y up; the camera lies
on +z and looks along -z. Images are linear: no gamma is applied."""
SPLITS_TEXT = """The shapes are what the splits are cut by: the program gives each class of shapes,
mirror images included, to one of training, validation and test, for ever and whatever the seed.
`iqtt audit` of pix2shape-bench proves it of files that tell their shapes. Questions of `unlabeled`
have no answers beside them, but `truth/unlabeled` tells them: a learner must not look there."""
HELD = """**The answers to the test questions are not part of this data.** Those who made it hold
them and score predictions. Neither the files nor the index tell shapes, views, kinds or angles of
test questions. Whoever knows the seed can make the answers again, so no file tells it."""
GIVEN = """**The answers to the test questions are part of this data**, in `iqtt-test-answers.h5`
and in the index. Nothing keeps a method from having been chosen by them."""
RESPONSIBLE: dict[str, str | list[str]] = {
    "data_collection": "Nothing was collected. Shapes are drawn by a program from settings and a"
    " seed, turned and lit at random, and rendered by ray casting. The page README.md has all"
    " settings.",
    "data_collection_missing_data": "Questions of `unlabeled` and of the test have no answers"
    " beside them. Where depth is stored it is NaN on the background. Nothing is filled in.",
    "data_preprocessing_protocol": [
        "None: values are stored as they were rendered. Images of 8 bits are linear radiance from"
        " 0 to 1, rounded to 255 steps."
    ],
    "data_annotation_protocol": [
        "No person labelled anything. The right answer shows the reference's own shape, and the"
        " wrong ones shapes that no rotation takes to it. `iqtt audit` recomputes both from the"
        " stored cubes, with code that shares nothing with the program that made them."
    ],
    "data_use_cases": [
        "Training and testing methods that tell whether two pictures show the same shape, with few"
        " labels or none.",
        "Comparing such methods under one protocol, with bench score of pix2shape-bench.",
        "Not for measuring mental rotation in people, and not for deciding how well a method does"
        " on photographs.",
    ],
    "data_limitations": [
        "One kind of shape, unit cubes face to face, before an empty background: no texture, no"
        " shadows, no noise of a sensor, no clutter.",
        "Views that hide a cube are refused, so that most views of a shape never occur.",
        "Three answers at most: a guess is right in a third or half of the questions.",
    ],
    "data_biases": [
        "Questions of the kind `other`, and some of `near`, can be answered from outlines alone."
        " Report `matched` and `mirror-pair`, where outlines tell little or nothing.",
        "In `mirror-pair` with three answers the right one is the odd one out, and can be found"
        " without the reference, by the same mental rotation between answers.",
        "Each number of cubes is asked for equally often, though there are far more shapes of many"
        " cubes; shapes of few cubes recur, seen from other sides.",
    ],
    "personal_sensitive_information": [
        "None: no people, no places, no text in the images. The recorded command, where the page"
        " has it, holds names of files of those who made the data."
    ],
}
