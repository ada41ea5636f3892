"""How fast scenes of models are rendered, beside one Mitsuba render a scene: one Markdown table.

`python -m benchmarks.models [--quick]`, from the repository's root. It measures the built-in
objects, a folder of meshes with 20,480 faces each that is made here, and what `--shading path`
costs.
"""

from collections.abc import Iterator

from benchmarks.report import Job, Row, print_report

MESHES = 60  # models of 20,480 faces, in three classes
NOTES = (
    "MiB: peak memory of the process. The first run of a folder reads and cleans its meshes, and\n"
    "built-in objects are made when first used; runs that are marked as cached find them on disk.\n"
    "Plain Mitsuba has its meshes in memory, writes no file and makes no ids; the faster of two\n"
    "ways to load them counts. The stage alone renders scenes that were sampled before; their\n"
    "models are kept from a first pass over them."
)


def jobs(folder: str, quick: bool) -> Iterator[Job]:
    """Yield the jobs; the first writes the folder of meshes."""
    totals = (1000, 1000) if quick else (1000, 5000, 5000, 20000)
    of_folder, stage, plain, paths = (256, 128, 8, 16) if quick else (2000, 512, 60, 64)
    root = f"{folder}/meshes"
    yield "", "", "rooms:make_meshes", {"folder": root, "count": MESHES}
    for key, what, where, counts in (
        ("shapenet", "built-in objects, 2-4 a scene", "", totals),
        ("folder", "20,480-face meshes, 2-4 a scene", root, (of_folder, of_folder)),
    ):
        rooms = f"{folder}/{key}.h5"
        for run, count in enumerate(counts):
            again = counts[:run].count(count)
            nth = ", cached" if again else ""
            how = {"rooms": rooms, "count": count, "preset": "shapenet", "root": where}
            how["cache"] = f"{folder}/cache-{key}-{count}"
            line = f"scenegen, {what}, end to end, N = {count:,}{nth}"
            yield f"{key} {count} {run}", line, "rooms:from_nothing", how
        shared = {"rooms": rooms, "repeats": 1 if quick else 3, "root": where}
        line = f"scenegen, {what}, rendering stage alone"
        yield f"{key} stage", line, "rooms:stage", {**shared, "count": stage}
        for variant in ("llvm_ad_rgb", "scalar_rgb"):
            line = f"load_dict + render, {variant}, the same meshes"
            how = {**shared, "count": plain, "variant": variant, "coarse": False, "folder": folder}
            how |= {"ways": ["files", "merged"]}
            yield f"{key} plain {variant}", line, "plain_mitsuba:per_scene", how
    for shading, more in (("paper", ""), ("path", ", 64 samples")):
        how = {"rooms": f"{folder}/shading.h5", "count": paths, "preset": "shapes"}
        line = f"scenegen, basic shapes, --shading {shading}{more}"
        yield shading, line, "rooms:from_nothing", {**how, "shading": shading}


def print_ratios(rows: dict[str, Row]) -> None:
    """Print how much faster than plain Mitsuba we are, and what paths cost."""
    for key, goal in (("shapenet", 8.0), ("folder", 4.0)):
        plain = max(row.best for name, row in rows.items() if name.startswith(f"{key} plain"))
        ours = {name: row for name, row in rows.items() if name.startswith(key)}
        for name, row in ours.items():
            if " plain" not in name and plain:
                less = goal / 2 if key == "shapenet" and "cached" not in row.what else goal
                print(f"- {row.what} / plain: {row.best / plain:.1f}; goal {less:g}")
    if rows["path"].best:
        print(f"- --shading paper / path: {rows['paper'].best / rows['path'].best:.0f}")


if __name__ == "__main__":
    print_report(__doc__, jobs, "128x128, depth and normals", NOTES, print_ratios)
