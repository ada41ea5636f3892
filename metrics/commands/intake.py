"""The `bench` commands that make submissions: from folders of files, and from a model."""

import shlex
from collections.abc import Callable
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from scenegen.command_line.groups import EXAMPLE
from scenegen.command_line.options import ENCODING, OVERWRITE, Command, Renamed, together
from scenegen.command_line.output import print_line, progress_bar
from scenegen.command_line.paths import InputPath, NewHdf5

if TYPE_CHECKING:
    from metrics.intake.reading import Reading


class Factor(click.ParamType):  # type: ignore[type-arg]
    """`0.001` or `1/256`, as a float."""

    name = "NUMBER or N/M"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse a text."""
        try:
            return float(Fraction(value)) if isinstance(value, str) else value
        except (ValueError, ZeroDivisionError, OverflowError):
            self.fail(f"found {value!r:.40}, expected a number such as 0.001 or 1/256", param, ctx)


class ModelName(InputPath):
    """A Python file, or the name of a public model."""

    name = "model"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Take names as they are, and paths as `InputPath` does."""
        from metrics.intake.model_file import LIBRARIES

        return value if value.startswith(LIBRARIES) else super().convert(value, param, ctx)


ALIGNMENTS = ("none", "median_scale", "scale", "scale_shift")
DEPTH_KINDS = ("depth", "disparity", "distance")
DATA = click.option(
    "--data", "truth", type=InputPath(), required=True, metavar="ROOMS.h5",
    help="File of rooms or questions that the predictions are for.",
)  # fmt: skip
OUT = click.option(
    "--out", type=NewHdf5(), required=True, metavar="PREDICTIONS.h5", help="Output file."
)
METHOD = click.option(
    "--method", help="Name of the method in tables [default: the name of the model or folder]."
)
RUN = click.option(
    "--run", "run_name", default="", help="Name of the training run, such as its seed."
)
NOTES = click.option("--notes", default="", help="Note that is stored in the output file.")
FRAME = click.option(
    "--frame", type=click.Choice(["opencv", "opengl"]), default="opencv", show_default=True,
    help="Axes of points and normals. opencv: x right, y down, z forward; opengl: x right, y up, z"
    " towards the viewer.",
)  # fmt: skip
MISSING = click.option(
    "--missing", type=click.Choice(["refuse", "nearest"]), default="refuse", show_default=True,
    help="What to do with pixels without a predicted value. refuse: stop with an error; nearest:"
         " copy the value of the nearest valid pixel.",
)  # fmt: skip


def reading_options(*kinds: str) -> Callable[[Command], Command]:
    """Return the options of `bench import` and `truth` that describe the values in files."""
    points = "; points: x, y, z" if "points" in kinds else ""
    return together(
        click.option(
            "--kind", type=click.Choice(kinds), default="depth", show_default=True,
            help="Type of the values. depth: planar depth; disparity: 1 / depth, larger for closer"
            " pixels; distance: distance along the ray" + points + "."),
        click.option("--unit", type=click.Choice(["m", "cm", "mm"]),
                     help="Unit of the values. 1 m is one scene unit."),
        click.option("--scale", type=Factor(),
                     help="Factor that converts stored values to metres, such as 1/256. For"
                     " disparity, the factor converts to 1 / metres."),
        click.option("--invalid", type=float, multiple=True,
                     help="Stored value that marks invalid pixels, such as 0. Repeatable."),
        click.option("--normals", metavar="FILES",
                     help="Files with normals, in the formats of --depth. Integer values are mapped"
                          " to the range -1 to 1."),
        FRAME,
        click.option("--array", help="Name of the array to read from NPZ files, or of the channel"
                                     " to read from EXR files."),
        click.option("--match", type=click.Choice(["number", "name"]), default="number",
                     show_default=True, help="How files are assigned to images. number: a file"
                                             " belongs to the image with the same name or number;"
                                             " name: the first file in alphabetical order belongs"
                                             " to the first image, and so on."),
    )  # fmt: skip


def read_as(
    *, unit: str | None, scale: float | None, alignment: Any = None, missing: Any = "refuse",
    **numbers: Any,
) -> "Reading":  # fmt: skip
    """Return what `reading_options` say of the numbers in files."""
    from metrics.intake.reading import UNITS, Reading

    if unit and scale:
        raise click.UsageError("give --unit or --scale, not both")
    factor = scale if scale is not None else UNITS[unit or "m"]
    return Reading(scale=factor, alignment=alignment, missing=missing, **numbers)


# fmt: off
@click.command("import", epilog=f"{EXAMPLE}bench import --depth 'out/*.png' --unit mm"
                                " --invalid 0 --data rooms.h5 --out mine.h5")
@click.option("--depth", "pattern", metavar="FILES",
              help="Predicted depth: a folder, a quoted pattern such as 'out/*.png', or one NPY or"
              " NPZ file for all images. Formats: PNG, TIFF, EXR, PFM, NPY and NPZ.")
@click.option("--layers", metavar="FILES",
              help="Predictions of all surfaces along each ray, instead of --depth: NPY or NPZ"
                   " files with depths (h, w, L) or points (h, w, L, 3). The nearest layer comes"
                   " first. After the last layer of a ray, values are NaN.")
@click.option("--meshes", metavar="FILES",
              help="Predictions of whole objects, in the camera frame, instead of --depth. Each"
                   " image has one GLB, PLY or OBJ file, or one folder of such files, as in"
                   " 'out/*/*.glb'.")
@reading_options(*DEPTH_KINDS, "points")
@click.option("--alignment", type=click.Choice(ALIGNMENTS),
              help="Alignment to the ground truth that the predictions need. For example, depth"
                   " with an unknown scale needs `scale`. Disparity with an unknown shift, such as"
                   " disparity up to scale and shift, needs `scale_shift` [default: none;"
                   " scale_shift for disparity].")
@click.option("--confidence", metavar="FILES",
              help="Files with the confidence of each pixel, in the formats of --depth. The values"
                   " may have any scale.")
@click.option("--confidence-is", type=click.Choice(["confidence", "error"]), default="confidence",
              show_default=True, help="What a larger value in the files of --confidence means."
                                      " confidence: the prediction is more certain; error: the"
                                      " expected error is larger.")
@MISSING
@click.option("--input-view", "shown", cls=Renamed, former="--shown",
              type=click.Choice(["scored_view", "first_view", "no_view"]), default="scored_view",
              show_default=True, help="Image that the model got as input. scored_view: the image of"
                                      " the scored view; first_view: the image of the first view of"
                                      " the scene; no_view: no image.")
@click.option("--responses", "answers", cls=Renamed, former="--answers", type=InputPath(),
              metavar="FILE",
              help="Responses to questions, instead of --depth: a .csv, .json or .jsonl file, or a"
                   " log of Inspect (.eval), lmms-eval (.jsonl) or VLMEvalKit (.tsv, .xlsx).")
@click.option("--quiz", "people", metavar="FILES",
              help="Responses of people to questions, instead of --depth: a folder or a quoted"
                   " pattern of the JSON files that the page of `iqtt quiz` saves. --out is then a"
                   " folder, which gets one submission per person.")
@DATA
@OUT
@METHOD
@RUN
@NOTES
@OVERWRITE
@click.argument("expanded", nargs=-1, metavar="")
def import_(
    pattern: str | None, alignment: Any, missing: Any, normals: str | None, shown: Any,
    answers: str | None, people: str | None, truth: str, out: str, method: str | None,
    run_name: str, notes: str, overwrite: bool, expanded: tuple[str, ...],
    confidence: str | None, confidence_is: str, layers: str | None, meshes: str | None,
    **numbers: Any,
) -> None:
    """Convert files of predictions to a submission.

    By default, files are assigned to images by the numbers in their names. A missing, extra or
    duplicate file is an error. If predictions have another size than the ground truth, they are
    resampled to its size.
    """
    from scenegen.files.new_file import check_writable

    texts: dict[str, Any] = {"run": run_name, "notes": notes, "overwrite": overwrite}
    if expanded:
        why = "the shell has expanded a pattern"
        raise click.UsageError(f"{expanded[0]}: {why}; quote patterns, such as 'out/*.png'")
    if sum(source is not None for source in (pattern, layers, meshes, answers, people)) != 1:
        ways = "--depth, --layers or --meshes for rooms"
        raise click.UsageError(f"give {ways}, or --responses or --quiz for questions")
    if people is not None:
        from metrics.intake.answers.quiz_answers import import_quiz
        from metrics.intake.folders import files_of

        made = import_quiz(
            files_of(people, (".json",)), truth, out,
            method=method or "people", notes=notes, overwrite=overwrite,
        )
        print_line(f"{out}: responses of {len(made)} people")
        score = f"bench score {shlex.quote(out.rstrip('/'))}/*.h5 --allow-partial --truth"
        print_line(f"now: {score} ANSWER_KEY.h5")
        return
    check_writable(Path(out), overwrite)
    if answers is not None:
        _import_answers(answers, truth, out, method, texts)
        return
    pattern = pattern or layers or meshes
    assert pattern is not None
    from metrics.intake.importing import import_rooms
    from metrics.intake.meshes import import_meshes
    from metrics.measured.reader import open_images

    numbers["surer"] = "less" if confidence_is == "error" else "more"
    reading = read_as(alignment=alignment, missing=missing, layered=layers is not None, **numbers)
    importing: Callable[..., str] = import_rooms
    more = {"normals": normals, "confidence": confidence}
    if meshes is not None:
        importing, more = import_meshes, {}
    with open_images(truth) as rooms:
        with progress_bar(len(rooms), "image") as bar:
            how = importing(
                pattern, rooms, out, method=method or _name_of(pattern), reading=reading,
                shown=shown, progress=bar.update, **more, **texts,
            )
        print_line(f"{out}: {how}")
        _print_hints(out, rooms)


# fmt: on
def _import_answers(
    answers: str, truth: str, out: str, method: str | None, texts: dict[str, Any]
) -> None:
    """Make a submission of a list of responses, or of the log of a harness."""
    from iqtt.files.reader import open_questions
    from metrics.intake.answers.answer_files import import_answers
    from metrics.intake.answers.harness_logs import is_log, read_returned, write_returned

    with open_questions(truth) as questions:
        if is_log(answers):
            log = read_returned(answers)
            texts["notes"] = texts["notes"] or log.settings
            count = write_returned(out, truth, log, method=method or "", **texts)
            for note in log.notes:
                print_line(f"{answers}: {note}")
        else:
            name = method or Path(answers).stem
            count = import_answers(answers, questions, out, method=name, **texts)
        of_all = f" of {len(questions)}" if count < len(questions) else ""
    print_line(f"{out}: responses to {count}{of_all} questions")


def _name_of(pattern: str) -> str:
    """Return the name of the folder that files lie in, for tables."""
    path = Path(pattern)
    folder = next(place for place in (path, *path.parents) if place.is_dir())
    return folder.resolve().name or "predictions"


def _print_hints(out: str, data: Any) -> None:
    """Print what a submission holds, hints on mistakes, and the next command.

    `data` is the open file that was predicted.
    """
    from metrics.submissions.reader import RoomPredictions, open_predictions
    from metrics.submissions.validation import hints

    with open_predictions(out) as opened:
        if isinstance(opened, RoomPredictions):
            more = ", with normals" if opened.has_normals else ""
            more += ", with confidence" if opened.has_confidence else ""
            print_line(f"{out}: {opened.kind}, alignment {opened.alignment}{more}")
            for hint in hints(opened, data):
                print_line(f"hint: {out}: {hint}", err=True)
    print_line(f"now: {shlex.join(['bench', 'score', out, '--truth', str(data.path)])}")


# fmt: off
@click.command(epilog=f"{EXAMPLE}bench run my_model.py --data rooms.h5 --out mine.h5")
@click.argument("model", type=ModelName(), metavar="MODEL")
@click.argument("words", nargs=-1, type=click.UNPROCESSED, metavar="[-- OPTIONS]")
@DATA
@OUT
@METHOD
@RUN
@NOTES
@click.option("--device", help="Device of the model, such as cuda. In a Python file, load(device)"
                               " gets this value.")
@click.option("--dtype", help="Data type of the model, such as bfloat16. In a Python file,"
                              " load(dtype) gets this value.")
@click.option("--python", type=InputPath(), metavar="PROGRAM",
              help="Python interpreter of another environment to run the model in, such as"
              " ~/envs/da3/bin/python. The environment needs Python 3.9 or newer and NumPy, but not"
              " this package.")
@click.option("--batch", type=click.IntRange(1, 4096),
              help="Number of images per call of infer_batch(). If the load() of a Python file has"
                   " the argument batch, it also gets this value [default: 8].")
@click.option("--intrinsics", is_flag=True,
              help="Pass the true camera matrix to the model. The output file records this option.")
@ENCODING
@click.option("--exposure", type=Factor(), default=1.0, show_default=True,
              help="Factor by which the radiance of the input images is multiplied. A product above"
                   " 1 is an error.")
@click.option("--key", help="Key of the value to use in the dict that the model returns [default:"
                            " the first of the keys above that the dict has].")
@FRAME
@MISSING
@click.option("--resume", "keep", flag_value="resume",
              help="Keep the predictions of an interrupted run, even if the model, its weights or"
                   " the options have changed.")
@click.option("--restart", "keep", flag_value="restart",
              help="Discard the predictions of an interrupted run, and start again.")
@click.option("--timeout", type=click.FloatRange(0, min_open=True), metavar="SECONDS",
              help="Abort the run if one call of the model takes longer than this time.")
@click.option("--traceback", is_flag=True, help="Show the full traceback of an error in the model.")
@OVERWRITE
def run(
    model: str, words: tuple[str, ...], truth: str, out: str, method: str | None, run_name: str,
    notes: str, device: str | None, dtype: str | None, python: str | None, batch: int | None,
    intrinsics: bool, curve: str, exposure: float, key: str | None, frame: Any, missing: Any,
    keep: str | None, timeout: float | None, traceback: bool, overwrite: bool,
) -> None:
    """Run a model on every image of a file, and write the predictions.

    MODEL is a Python file or a public depth model. A public model is hf:NAME for the package
    transformers, or moge:NAME for MoGe.

    For rooms, the Python file defines infer(image). The image is an RGB array (H, W, 3), uint8.
    infer returns a dict with one of the keys below. With --intrinsics, the call is infer(image,
    intrinsics). For questions, the file defines infer(reference, answers). This function returns
    the index of an option, or one score per option.

    Instead of the function infer, the file can define a class with the method infer, or a function
    load() that returns an object with this method. MODEL can also be a file of MoGe's evaluation
    code. The OPTIONS after -- are passed to the load() of that file. docs/evaluate.md has examples.

    \b
    Keys of the dict:
    points_metric, depth_metric: in metres; in box rooms, in scene units
    points_scale_invariant, depth_scale_invariant: up to a scale
    points_affine_invariant, depth_affine_invariant: up to scale and shift
    disparity_affine_invariant: 1 / depth, up to scale and shift
    layers_metric, layers_scale_invariant, layers_affine_invariant: depths of all surfaces along
    each ray, (h, w, L), or points (h, w, L, 3)

    Re-run the same command to resume an interrupted run.
    """  # noqa: D301 - \b is click's mark: lines stay as they are
    from metrics.intake.model_file import LIBRARIES, ModelError, opened_model
    from metrics.intake.outputs import KEYS
    from metrics.intake.running import DEFAULT_BATCH, Call, run_model
    from metrics.submissions.truths import open_data
    from scenegen.files.new_file import check_writable

    check_writable(Path(out), overwrite)
    if key is not None and key not in KEYS:
        raise click.BadParameter(f"found {key!r:.40}, expected one of {', '.join(KEYS)}",
                                 param_hint="--key")
    named = model.startswith(LIBRARIES)
    # A public model makes batches of any size; only the key of one that is not known is its affair.
    asked = {"device": device, "dtype": dtype, "batch": None if named else batch}
    asked |= {"key": key} if model.startswith("hf:") else {}
    options = {name: value for name, value in asked.items() if value is not None}
    loaded = None
    kept = {**options, "arguments": words} if words else options
    call = Call(curve, exposure, intrinsics, batch or DEFAULT_BATCH, frame, key, missing)
    try:
        with open_data(truth) as data:
            with (
                opened_model(
                    model, options, timeout, partial(print_line, err=True), arguments=words,
                    python=python,
                ) as loaded,
                progress_bar(len(data), "row") as bar,
            ):
                said = run_model(
                    loaded, data, out, call=call, method=method or loaded.title, run=run_name,
                    notes=notes, overwrite=overwrite, keep=keep, options=kept,
                    progress=bar.update,
                )
            print_line(f"{out}: {said}")
            _print_hints(out, data)
    except ModelError as error:
        if traceback and error.traceback:
            print_line(error.traceback, err=True)
        elif error.traceback:
            error.hint = "; ".join(filter(None, (error.hint, "--traceback shows all of it")))
        raise
    except KeyboardInterrupt:
        at = f" at {loaded.calls[0]}" if loaded is not None and loaded.calls else ""
        print_line(f"stopped{at}; re-run the same command to resume with {out}.rows", err=True)
        raise


# fmt: on
COMMANDS = (import_, run)
