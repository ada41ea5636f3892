"""The commands that are tried: each target is some command lines that succeed on honest files."""

from pathlib import Path

TARGETS = {
    "score rooms": (
        "bench score predictions.h5 --processes 1 --json new.json --csv new.csv",
        "bench score predictions.h5 --truth rooms.h5 --processes 1 --html new.html",
        "bench score constant.h5 --processes 1 --non-finite penalise --allow-partial",
    ),
    "score answers": (
        "bench score answers.h5 --truth iqtt/iqtt-test-answers.h5 --json new.json",
        "bench score answers.json --truth iqtt/iqtt-test-answers.h5 --csv new.csv",
        "bench score answers.h5 --truth iqtt/iqtt-test.h5",
        "bench score named.json --truth iqtt/iqtt-val.h5 --allow-partial",
    ),
    "validate": (
        "bench validate predictions.h5 --truth rooms.h5",
        "bench validate predictions.h5",
        "bench validate answers.h5",
        "bench validate named.json --truth iqtt/iqtt-test.h5",
    ),
    "compare": (
        "bench compare scores.json other.json --json new.json",
        "bench compare other.json scores.json --metric chamfer --markdown",
    ),
    "leaderboard": (
        "bench leaderboard scores.json other.json answer-scores.json",
        "bench leaderboard scores.json other.json --format html --out new.html",
        "bench leaderboard answer-scores.json --format latex --no-paper",
    ),
    "baselines": (
        "bench baseline constant --train train.h5 --data rooms.h5 --out new.h5",
        "bench baseline mean-depth --train train.h5 --data rooms.h5 --out new.h5",
        "bench baseline empty-room --data rooms.h5 --out new.h5",
        "bench baseline oracle --data rooms.h5 --out new.h5",
        "bench baseline chance --data iqtt/iqtt-test.h5 --out new.h5",
    ),
    "rooms": (
        "scenegen info rooms.h5",
        "scenegen preview rooms.h5 --items 0-3 --out new.png",
        "scenegen verify rooms.h5 --items 0",
        "scenegen card rooms.h5 --creator A --date 2026-01-31 --out new",
        *(
            f"scenegen export rooms.h5 --items 0,2 --format {form} --out new"
            for form in ("png", "ply", "exr", "obj", "parquet", "webdataset")
        ),
    ),
    "meshes": (
        "scenegen check-objects meshes --json new.json --cache-dir new",
        "scenegen export models.h5 --items 0-2 --format obj --out new --objects-root meshes"
        " --cache-dir cache",
    ),
    "questions": (
        "iqtt info iqtt/iqtt-train.h5",
        "iqtt info iqtt/iqtt-test.h5",
        "iqtt show iqtt/iqtt-val.h5 --answers --out new.png",
        "iqtt show iqtt/iqtt-test.h5 --answers --out new.png",
        "iqtt show iqtt/iqtt-train.h5 --part labeled --answers --out new.png",
        "iqtt show released.h5 --out new.png",
        "iqtt card iqtt --creator A --date 2026-01-31 --out new",
        "iqtt export iqtt/iqtt-train.h5 --part labeled --format parquet --out new",
        "iqtt export released.h5 --format webdataset --out new",
        "iqtt verify iqtt --items 0",
        "iqtt audit iqtt --json new.json",
        "iqtt audit released.h5",
    ),
    "people": (
        "iqtt quiz-report people.db --json new.json --html new.html",
        "iqtt quiz-report people.db --model named.json",
        "iqtt quiz --db people.db --export new.csv",
        "iqtt quiz iqtt/iqtt-test.h5 --db people.db --submission new.h5 --whose majority",
    ),
    "weights": (
        "pix2shape predict --weights weights.safetensors --data rooms.h5 --out new.h5",
        "pix2shape sample --weights weights.safetensors --n 1 --out new.png",
        "pix2shape interpolate --weights weights.safetensors --data rooms.h5 --steps 2"
        " --out new.png",
        "pix2shape rotate --weights weights.safetensors --data rooms.h5 --items 0 --frames 2"
        " --out new.gif",
        "bench baseline pix2shape-compact --weights weights.safetensors --data rooms.h5"
        " --out new.h5",
    ),
}
WITH_TORCH = ("weights",)  # targets that import it; a process that has imported torch forks slowly
# Targets with an exit code of 1 that says something about the input.
CAN_FIND_FAULTS = ("rooms", "meshes", "questions")
# Options that name what is written.
OUTPUTS = ("--out", "--json", "--csv", "--html", "--export", "--submission")
SUBMISSIONS = ("predictions.h5", "constant.h5", "answers.h5")  # what strangers hand in
# Files that a command finds by way of others.
FOUND_BY = {
    "predictions.h5": ["rooms.h5"],
    "constant.h5": ["rooms.h5"],
    "iqtt/iqtt-test.h5": ["iqtt/iqtt-test-answers.h5"],
}


def inputs(words: list[str], honest: Path) -> list[str]:
    """Return the files of the honest folder that a command line reads."""
    names = [name for word in words for name in [word, *FOUND_BY.get(word, [])]]
    files = []
    for name in names:
        path = honest / name
        found = sorted(path.rglob("*")) if path.is_dir() else [path]
        files += [str(file.relative_to(honest)) for file in found if file.is_file()]
    return files
