"""`bench ask`: put the questions of a file to a model behind a server."""

import os
from pathlib import Path
from typing import Any

import click

from iqtt.commands.models import model_options
from scenegen.command_line.groups import EXAMPLE, UserError, needs
from scenegen.command_line.options import OVERWRITE
from scenegen.command_line.output import print_line, progress_bar
from scenegen.command_line.paths import InputPath, NewHdf5, OutputPath

SERVER = "http://127.0.0.1:8000/v1"


@click.command(
    epilog=f"{EXAMPLE}bench ask iqtt-split/iqtt-test.h5 --model openai:my-model"
    f" --base-url {SERVER} --log asked.jsonl --out predictions.h5"
)
@click.argument("file", type=InputPath())
@click.option(
    "--model",
    required=True,
    metavar="openai:NAME",
    help="Model that the server knows; openai is the protocol.",
)
@click.option(
    "--base-url",
    default=SERVER,
    show_default=True,
    help="Address of the server: vLLM, llama.cpp, Ollama or any other of the protocol.",
)
@click.option(
    "--key-from",
    default="OPENAI_API_KEY",
    show_default=True,
    help="Environment variable that holds the key. The key is never written.",
)
@click.option(
    "--log",
    type=OutputPath(),
    default="asked.jsonl",
    show_default=True,
    help="JSON Lines of all replies. The same command goes on where it stopped.",
)
@click.option("--out", type=NewHdf5(), help="Submission to write, for `bench score`.")
@click.option(
    "--part", type=click.Choice(["labeled", "unlabeled"]), help="Part of a training file."
)
@click.option("--control", is_flag=True, help="Leave the reference out: a model must then guess.")
@click.option("--temperature", type=click.FloatRange(0, 2), default=0.0, show_default=True)
@click.option(
    "--max-tokens",
    type=click.IntRange(1, 1_000_000),
    default=1024,
    show_default=True,
    help="Most tokens of a reply, with its thoughts.",
)
@click.option(
    "--timeout",
    type=click.FloatRange(0.1, 3600),
    default=120.0,
    show_default=True,
    help="Seconds that a reply may take.",
)
@click.option(
    "--tries",
    type=click.IntRange(1, 100),
    default=6,
    show_default=True,
    help="Most requests for one row, with growing pauses.",
)
@click.option(
    "--concurrency",
    type=click.IntRange(1, 256),
    default=4,
    show_default=True,
    help="Requests at the same time.",
)
@click.option(
    "--prices",
    type=(float, float),
    metavar="IN OUT",
    help="Prices of a million tokens, of the prompt and of the reply; the cost is shown.",
)
@model_options
@OVERWRITE
def ask(
    file: str,
    model: str,
    base_url: str,
    key_from: str,
    log: str,
    out: str | None,
    part: str | None,
    control: bool,
    prices: tuple[float, float] | None,
    overwrite: bool,
    **options: Any,
) -> None:
    """Ask the questions of FILE to a model and keep every reply.

    Pictures are drawn anew from the cubes of FILE, in sRGB, with letters. A row is asked again if
    the server fails. A reply without a letter counts as no answer.
    """
    needs("bench ask", ("httpx",), "vlm")
    from iqtt.vlm.ask import Server, totals
    from iqtt.vlm.ask import ask as ask_rows
    from iqtt.vlm.reading import unread_note
    from iqtt.vlm.rows import Asked, count_rows
    from metrics.intake.harness_logs import read_returned, write_returned

    protocol, _, name = model.partition(":")
    if protocol != "openai" or not name:
        raise UserError(f"--model {model}: expected openai:NAME, such as openai:my-model")
    if out is not None and Path(out).exists() and not overwrite:
        raise FileExistsError(17, "exists; --overwrite replaces it", out)
    names = ("temperature", "max_tokens", "timeout", "tries", "concurrency")
    how = {key: options.pop(key) for key in names}
    server = Server(name, base_url, os.environ.get(key_from, ""), **how)
    asked = Asked(file, part, with_reference=not control, **options)
    with progress_bar(count_rows(asked), "question") as bar:
        replies = ask_rows(asked, server, log, bar.update)
    sums = totals(replies)
    print_line(
        f"{log}: {sums.rows} replies, {sums.unparsed} without a letter, {sums.refused} refused,"
        f" {sums.cut_off} cut off; {sums.input_tokens:,} + {sums.output_tokens:,} tokens"
    )
    unread = [(reply["id"], reply["text"]) for reply in replies if reply["letter"] is None]
    print_line(f"{log}: {unread_note(unread, sums.rows)}")
    if sums.cut_off:
        spent = f", {sums.only_thoughts} of them in thoughts" if sums.only_thoughts else ""
        advice = "use a larger --max-tokens, with a new --log"
        print_line(
            f"{log}: {sums.cut_off} of {sums.rows} replies were cut off at --max-tokens"
            f" {server.max_tokens}{spent}; {advice}"
        )
    if any("temperature" not in reply.get("settings", {"temperature": 0}) for reply in replies):
        print_line(f"{log}: the server has one temperature, and was asked without --temperature")
    if prices is not None:
        cost = (sums.input_tokens * prices[0] + sums.output_tokens * prices[1]) / 1e6
        print_line(f"{log}: cost {cost:.4f}, at {prices[0]:g} and {prices[1]:g} a million tokens")
    if sums.known:
        print_line(
            f"{log}: {sums.right} of {sums.known} rows right; {sums.unread / sums.rows:.0%} unread"
        )
    if out is not None:
        write_returned(out, file, read_returned(log), part=part, overwrite=overwrite)
        print_line(f"{out}: answers of {name}; next: bench score {out}")


COMMANDS = (ask,)
