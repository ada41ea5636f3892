"""`bench ask`: put the questions of a file to a model, with Inspect."""

from pathlib import Path
from typing import Any

import click

from iqtt.commands.models import model_options
from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import OVERWRITE
from scenegen.command_line.output import print_line
from scenegen.command_line.paths import InputPath, NewHdf5, OutputFolder


# fmt: off
@click.command(
    epilog=f"{EXAMPLE}bench ask iqtt-split/iqtt-test.h5 --model openai/NAME --out predictions.h5"
)
@click.argument("file", type=InputPath())
@click.option("--model", required=True, metavar="PROVIDER/NAME",
              help="Model, as Inspect names it: openai/NAME, vllm/NAME, ollama/NAME,"
              " openai-api/SERVICE/NAME for a server that speaks OpenAI's protocol.")
@click.option("--base-url", metavar="URL",
              help="Address of the server [default: the provider's own].")
@click.option("--log-dir", type=OutputFolder(), default="logs", show_default=True,
              help="Folder of Inspect's logs. The same command goes on where it stopped.")
@click.option("--out", type=NewHdf5(), required=True, help="Submission to write.")
@click.option("--control", is_flag=True, help="Leave the reference out: a model must then guess.")
@click.option("--temperature", type=click.FloatRange(0, 2), default=0.0, show_default=True)
@click.option("--max-tokens", type=click.IntRange(1, 1_000_000), default=1024, show_default=True,
              help="Most tokens of a reply, with its thoughts.")
@click.option("--timeout", type=click.IntRange(1, 3600), default=120, show_default=True,
              help="Seconds that a reply may take.")
@click.option("--tries", type=click.IntRange(1, 100), default=6, show_default=True,
              help="Most requests for one row, with growing pauses.")
@click.option("--concurrency", type=click.IntRange(1, 256), default=4, show_default=True,
              help="Requests at the same time.")
@model_options
@OVERWRITE
def ask(
    file: str, model: str, base_url: str | None, log_dir: str, out: str, control: bool,
    temperature: float, max_tokens: int, timeout: int, tries: int, concurrency: int,
    overwrite: bool, **asked: Any,
) -> None:
    """Ask the questions of FILE to a model, and write its answers as a submission.

    Pictures are drawn anew from the cubes of FILE, in sRGB, with letters. Inspect asks, and keeps
    every reply in a log, which `inspect view` shows. A row that failed is left out, and asked again
    by the same command. A reply without a letter counts as no answer.
    """
    needs("bench ask", ("inspect_ai",), "vlm")
    from iqtt.vlm.rows import Asked, count_rows
    from metrics.intake.answers.asking import ask as ask_rows
    from metrics.intake.answers.harness_logs import read_returned, write_returned
    from scenegen.files.new_file import check_writable

    check_writable(Path(out), overwrite)
    count_rows(Asked(file, with_reference=not control, **asked))  # refuses what cannot be asked
    paths = {name: str(Path(asked.pop(name)).absolute()) for name in ("answers",) if asked[name]}
    task = {"path": str(Path(file).absolute()), "control": control, **asked, **paths}
    settings = {
        "temperature": temperature, "max_tokens": max_tokens, "attempt_timeout": timeout,
        "max_retries": tries - 1, "max_connections": concurrency, "model_base_url": base_url,
    }
    log = read_returned(ask_rows(model, log_dir, task, settings))
    for note in log.notes:
        print_line(f"{log.path}: {note}")
    write_returned(out, file, log, overwrite=overwrite)
    print_line(f"{out}: answers of {log.model}; next: bench score {out}")


# fmt: on
COMMANDS = (ask,)
