"""Every page's blocks of bash and Python run in order, in an empty folder.

Pages with a test of what they print are run there.
"""

import pytest
from page_blocks import ROOT, blocks, run_block

RUN_ELSEWHERE = {"tutorial.md", "vlm.md", "your-model.md"}
CLUSTER = {"cluster.md"}  # needs a scheduler and its workers
README = "../README.md"
# What the README's first command makes, with smaller images.
BEFORE = {README: "scenegen render --n 4 --size 32 --out rooms.h5"}


def runnable(page):
    return [block for block in blocks(page) if block[0] in ("bash", "python")]


PAGES = [path.name for path in sorted((ROOT / "docs").glob("*.md"))]
RUN_HERE = [p for p in (*PAGES, README) if runnable(p) and p not in RUN_ELSEWHERE | CLUSTER]


@pytest.mark.parametrize("page", RUN_HERE)
def test_the_blocks_run(page, tmp_path):
    if page == "sharing.md":
        pytest.importorskip("datasets")
    home = f"export HOME={tmp_path}\n"  # blocks that write to it write here
    if page in BEFORE:
        run_block("bash", "", BEFORE[page], tmp_path)
    for language, title, code in runnable(page):
        run_block(language, title, home + code if language == "bash" else code, tmp_path)
