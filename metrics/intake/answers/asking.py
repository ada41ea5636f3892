"""Asking a model the questions of a file with Inspect, which retries, resumes and keeps a log."""

import re
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

from scenegen.common.errors import SceneGenError


class AskError(SceneGenError):
    """A model that Inspect could not ask."""


def ask(
    model: Any, log_dir: str | Path, task: Mapping[str, Any], settings: Mapping[str, Any]
) -> Path:
    """Ask a model and return the log; what other processes of Inspect print goes to stderr.

    Where the folder has a log of the same model, questions and settings, rows with a reply are not
    asked again.

    Args:
        model: a name such as openai/NAME, or a model of Inspect.
        log_dir: folder of logs.
        task: arguments of `pix2shape_bench.questions`, apart from defaults.
        settings: of `inspect_ai.eval_set`, such as `temperature` and `max_tokens`.

    Raises AskError where Inspect refuses the model, the settings or the questions.
    """
    from inspect_ai import eval_set
    from inspect_ai._util.error import PrerequisiteError
    from inspect_ai.model import get_model

    from pix2shape_bench import (
        questions,  # the object: its name is found only where it is installed
    )

    given = dict(settings)
    try:
        asked = get_model(model, base_url=given.pop("model_base_url", None))
    except (PrerequisiteError, ValueError) as error:  # no such provider, no key, no package
        found = _one_line(str(getattr(error, "message", error)))
        raise AskError(f"model {model}", found, "a model that Inspect can ask") from error
    try:
        with redirect_stdout(sys.stderr):
            _, logs = eval_set(
                questions(**task),
                log_dir=str(log_dir),
                log_dir_allow_dirty=True,  # logs of other models and questions stay
                model=asked,
                # A row that fails ends nothing, but the next run asks it again.
                fail_on_error=True,
                continue_on_fail=True,
                retry_attempts=0,
                retry_immediate=False,
                display="rich" if sys.stderr.isatty() else "none",
                **given,
            )
    except PrerequisiteError as error:
        found = _one_line(str(error.message))
        raise AskError(f"{log_dir}", found, "logs of this model and these questions") from error
    return Path(logs[0].location.removeprefix("file://"))


def _one_line(text: str) -> str:
    """Return a message of Inspect without its markup."""
    return " ".join(re.sub(r"\[/?[a-z ]*\]|ERROR: ?", "", text).split())
