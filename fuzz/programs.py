"""The commands that are tried: each target is some command lines that succeed on honest files."""

from dataclasses import dataclass

FORMATS = ("png", "ply", "exr", "obj", "parquet", "webdataset")
# Options that name what is written.
OUTPUTS = ("--out", "--json", "--csv", "--html", "--export", "--submission")


@dataclass(frozen=True)
class Target:
    """Command lines that do one kind of work.

    Attributes:
        lines: command lines on honest files; a case changes one of them, or its files.
        inputs: what of the honest folder they read, and a case may spoil.
        codes: exit codes that say something about the input, beside 0 and 2.
        imports_torch: whether it does; a process that has imported torch forks slowly.
    """

    name: str
    lines: tuple[str, ...]
    inputs: tuple[str, ...]
    codes: tuple[int, ...] = ()
    imports_torch: bool = False


MESHES = tuple(
    f"meshes/mug/{name}"
    for name in (
        "box.obj", "cylinder.stl", "ball.ply", "cone.off", "ring.glb", "text.stl", "text.ply",
    )
)  # fmt: skip
SPLIT = tuple(f"iqtt/iqtt-{name}.h5" for name in ("train", "val", "test", "test-answers"))

TARGETS = (
    Target(
        "score rooms",
        ("bench score predictions.h5 --processes 1 --json new.json --csv new.csv",
         "bench score predictions.h5 --truth rooms.h5 --processes 1 --html new.html",
         "bench score constant.h5 --processes 1 --non-finite penalise --allow-partial"),
        ("predictions.h5", "rooms.h5", "constant.h5"),
    ),
    Target(
        "score answers",
        ("bench score answers.h5 --truth iqtt/iqtt-test-answers.h5 --json new.json",
         "bench score answers.json --truth iqtt/iqtt-test-answers.h5 --csv new.csv",
         "bench score answers.h5 --truth iqtt/iqtt-test.h5",
         "bench score named.json --truth iqtt/iqtt-val.h5 --allow-partial"),
        ("answers.h5", "answers.json", "named.json", *SPLIT[1:]),
    ),
    Target(
        "validate",
        ("bench validate predictions.h5 --truth rooms.h5",
         "bench validate predictions.h5",
         "bench validate answers.h5",
         "bench validate named.json --truth iqtt/iqtt-test.h5"),
        ("predictions.h5", "rooms.h5", "answers.h5", "named.json", SPLIT[2]),
    ),
    Target(
        "compare",
        ("bench compare scores.json other.json --json new.json",
         "bench compare other.json scores.json --metric chamfer --markdown"),
        ("scores.json", "other.json"),
    ),
    Target(
        "leaderboard",
        ("bench leaderboard scores.json other.json answer-scores.json",
         "bench leaderboard scores.json other.json --format html --out new.html",
         "bench leaderboard answer-scores.json --format latex --no-paper",
         "bench leaderboard scores.json other.json answer-scores.json --recheck"),
        ("scores.json", "other.json", "answer-scores.json"),
    ),
    Target(
        "baselines",
        ("bench baseline constant --train train.h5 --data rooms.h5 --out new.h5",
         "bench baseline mean-depth --train train.h5 --data rooms.h5 --out new.h5",
         "bench baseline empty-room --data rooms.h5 --out new.h5",
         "bench baseline oracle --data rooms.h5 --out new.h5",
         "bench baseline chance --data iqtt/iqtt-test.h5 --out new.h5"),
        ("rooms.h5", "train.h5", SPLIT[2]),
    ),
    Target(
        "rooms",
        ("scenegen info rooms.h5",
         "scenegen preview rooms.h5 --items 0-3 --out new.png",
         "scenegen verify rooms.h5 --items 0",
         "scenegen card rooms.h5 --creator A --date 2026-01-31 --out new",
         *(f"scenegen export rooms.h5 --items 0,2 --format {form} --out new"
           for form in FORMATS)),
        ("rooms.h5",),
        (1,),
    ),
    Target(
        "meshes",
        ("scenegen check-objects meshes --json new.json --cache-dir new",
         "scenegen export models.h5 --items 0-2 --format obj --out new --objects-root meshes"
         " --cache-dir cache"),
        (*MESHES, "models.h5"),
        (1,),
    ),
    Target(
        "questions",
        ("iqtt info iqtt/iqtt-train.h5",
         "iqtt info iqtt/iqtt-test.h5",
         "iqtt show iqtt/iqtt-val.h5 --answers --out new.png",
         "iqtt show iqtt/iqtt-test.h5 --answers --out new.png",
         "iqtt show iqtt/iqtt-train.h5 --part labeled --answers --out new.png",
         "iqtt show released.h5 --out new.png",
         "iqtt card iqtt --creator A --date 2026-01-31 --out new",
         "iqtt export iqtt/iqtt-train.h5 --part labeled --format parquet --out new",
         "iqtt export released.h5 --format webdataset --out new",
         "iqtt audit iqtt --json new.json",
         "iqtt audit released.h5"),
        (*SPLIT, "released.h5"),
        (1,),
    ),
    Target(
        "people",
        ("iqtt quiz-report people.db --json new.json --html new.html",
         "iqtt quiz-report people.db --model named.json",
         "iqtt quiz --db people.db --export new.csv",
         "iqtt quiz iqtt/iqtt-test.h5 --db people.db --submission new.h5 --whose majority"),
        ("people.db", "named.json", *SPLIT[2:]),
    ),
    Target(
        "weights",
        ("pix2shape predict --weights weights.safetensors --data rooms.h5 --out new.h5",
         "pix2shape sample --weights weights.safetensors --n 1 --out new.png",
         "pix2shape interpolate --weights weights.safetensors --data rooms.h5 --steps 2"
         " --out new.png",
         "pix2shape rotate --weights weights.safetensors --data rooms.h5 --items 0 --frames 2"
         " --out new.gif",
         "bench baseline pix2shape --weights weights.safetensors --data rooms.h5 --out new.h5"),
        ("weights.safetensors", "weights.json", "rooms.h5"),
        imports_torch=True,
    ),
)  # fmt: skip
