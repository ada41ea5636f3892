"""`bench ask`: ask a vision-language model the questions of a file, with Inspect."""

import shlex
from pathlib import Path
from typing import Any

import click

from iqtt.commands.models import model_options
from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import OVERWRITE, Renamed
from scenegen.command_line.output import print_line
from scenegen.command_line.paths import InputPath, NewHdf5, OutputFolder


# fmt: off
@click.command(
    epilog=f"{EXAMPLE}bench ask iqtt-split/iqtt-test.h5 --model openai/NAME --out predictions.h5"
)
@click.argument("file", type=InputPath())
@click.option("--model", required=True, metavar="PROVIDER/NAME",
              help="Model name in Inspect: openai/NAME, vllm/NAME, ollama/NAME, or"
              " openai-api/SERVICE/NAME for another server with the OpenAI API.")
@click.option("--base-url", metavar="URL",
              help="URL of the server [default: the URL of the provider].")
@click.option("--log-dir", type=OutputFolder(), default="logs", show_default=True,
              help="Folder of the Inspect logs. Re-run the same command to resume from these logs.")
@click.option("--out", type=NewHdf5(), required=True, help="Output file of predictions.")
@click.option("--blind", "control", cls=Renamed, former="--control", is_flag=True,
              help="Blind control: ask without the reference image, so that the model can only"
                   " guess.")
@click.option("--temperature", type=click.FloatRange(0, 2), default=0.0, show_default=True,
              help="Sampling temperature.")
@click.option("--max-tokens", type=click.IntRange(1, 1_000_000), default=1024, show_default=True,
              help="Maximum number of tokens per reply, including reasoning.")
@click.option("--timeout", type=click.IntRange(1, 3600), default=120, show_default=True,
              help="Maximum time per reply, in seconds.")
@click.option("--tries", type=click.IntRange(1, 100), default=6, show_default=True,
              help="Maximum number of attempts per question. The pause becomes longer after each"
                   " attempt.")
@click.option("--concurrency", type=click.IntRange(1, 256), default=4, show_default=True,
              help="Number of concurrent requests.")
@model_options
@OVERWRITE
def ask(
    file: str, model: str, base_url: str | None, log_dir: str, out: str, control: bool,
    temperature: float, max_tokens: int, timeout: int, tries: int, concurrency: int,
    overwrite: bool, **asked: Any,
) -> None:
    """Ask a vision-language model the questions of FILE, and write its responses as predictions.

    The images are rendered again from the cubes of FILE, in sRGB, with letters on the options. The
    package Inspect sends the requests and logs every reply; `inspect view` shows the log. If a
    request fails, the output lacks its question. Re-run the same command to ask such questions
    again. If a reply has no answer, `bench score` counts it as wrong.
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
    print_line(f"{out}: responses of {log.model}")
    print_line(f"now: {shlex.join(['bench', 'score', out])}")


# fmt: on
COMMANDS = (ask,)
