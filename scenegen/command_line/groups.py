"""Groups of commands: what the user can mend is shown as one line, and ends with exit code 2."""

import importlib.util
import re
import shlex
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import click

from scenegen.command_line.output import print_line
from scenegen.command_line.streams import robust_streams
from scenegen.common.signals import ended_by_signals
from scenegen.common.text_table import printable

# An `epilog` is this and a command line. A paragraph that begins with \b keeps its line breaks.
EXAMPLE = "\b\nExample:\n  "
NO_MEMORY = re.compile(
    "out of memory|can't allocate memory|[Cc]annot allocate memory|not enough memory|ALLOC_FAILED"
)
LONGEST_ERROR = 2000  # characters; what a file holds may be of any length
WITHOUT_EFFECT = ("--batch", "--workers", "--scheduler")  # they change no byte of what is made


class PackageCommands(click.Group):
    """A group of the `COMMANDS` of some modules, which are imported when a command is asked for."""

    def __init__(self, *arguments: Any, modules: tuple[str, ...], **attributes: Any) -> None:
        super().__init__(*arguments, **attributes)
        self.modules = modules

    def list_commands(self, _ctx: click.Context) -> list[str]:
        """Return the names of the commands."""
        return [command.name for command in self._loaded()]

    def get_command(self, _ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command by name."""
        return next((command for command in self._loaded() if command.name == cmd_name), None)

    def format_commands(self, _ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the first sentence of each command's help, whole."""
        with formatter.section("Commands"):
            rows = [(command.name, command.get_short_help_str(400)) for command in self._loaded()]
            formatter.write_dl(rows)

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Find a command; the error for an unknown one tells those that are spelled alike."""
        self.commands = {command.name: command for command in self._loaded()}
        return super().resolve_command(ctx, args)

    def main(self, *arguments: Any, **attributes: Any) -> Any:
        """Run a command with streams and signals that keep it from leaving anything half done."""
        with ended_by_signals(), robust_streams():
            return super().main(*arguments, **attributes)

    def make_context(self, *arguments: Any, **attributes: Any) -> click.Context:
        """Read what stands before the command's name; print the help where it is asked for."""
        with _one_line_errors():
            return super().make_context(*arguments, **attributes)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Refuse arguments that no file could hold, before anything is done with them."""
        for text in args:
            if re.search("[\0\ud800-\udfff]", text):
                raise UserError(f"argument {text}: it holds bytes that are not UTF-8 text")
        return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; show what it raises for users, and its warnings, as one line each."""
        warnings.showwarning = _show_warning
        with _one_line_errors(), self._options_named(ctx):
            return super().invoke(ctx)

    @contextmanager
    def _options_named(self, ctx: click.Context) -> Iterator[None]:
        """Let an error about a setting name the option of the command that sets it."""
        try:
            yield
        except ValueError as error:
            from scenegen.common.errors import SceneGenError

            command = self.get_command(ctx, ctx.invoked_subcommand or "")
            options = {
                re.sub("[ _]", "-", name.lstrip("-")): param.opts[0]
                for param in (command.params if command else ())
                for name in (param.name, *param.opts)
            }
            if isinstance(error, SceneGenError):
                setting = re.sub("[ _]", "-", error.where)
                error.where = options.get(setting, error.where)
            raise

    def _loaded(self) -> list[Any]:
        modules = [importlib.import_module(name) for name in self.modules]
        return [command for module in modules for command in module.COMMANDS]


class UserError(click.ClickException):
    """A mistake that the user can mend; its text is shown as one line."""

    exit_code = 2

    def __init__(self, text: str) -> None:
        line = printable(text)
        if len(line) > LONGEST_ERROR:
            line = f"{line[: LONGEST_ERROR // 2]} ... {line[-LONGEST_ERROR // 2 :]}"
        super().__init__(line)


@contextmanager
def _one_line_errors() -> Iterator[None]:
    """Turn what a user can mend into a UserError."""
    try:
        yield
    except click.UsageError as error:
        text = " ".join(error.format_message().split())
        # An argument of many choices lists them twice.
        text = re.sub(r"Invalid value for '\{[^']*\}': ", "", text) + _spelled_alike(error)
        raise click.UsageError(UserError(text).message, error.ctx) from error
    except OSError as error:
        from scenegen.files.sets.making import CompleteError

        where = f"{error.filename}: " if error.filename else ""
        if isinstance(error, CompleteError):  # nothing is left to do, so the exit code is 0
            print_line(f"{where}{error.strerror}")
            return
        raise UserError(f"{where}{error.strerror or error}") from error
    except ImportError as error:
        if "map segment" not in str(error) and "allocate memory" not in str(error):
            raise
        raise UserError(f"not enough memory: {error}") from error
    except MemoryError as error:
        raise UserError(": ".join(filter(None, ("not enough memory", str(error))))) from error
    except RuntimeError as error:  # of torch and Dr.Jit, which have no narrower one in common
        if "start new thread" in str(error):
            hint = "raise the limit on processes and threads (ulimit -u), or use fewer --workers"
            raise UserError(f"the system starts no more threads; {hint}") from error
        told = [line for line in str(error).splitlines() if NO_MEMORY.search(line)]
        if not told:
            raise
        raise UserError(f"not enough memory: {told[0]}") from error
    except ValueError as error:
        from scenegen.common.errors import SceneGenError

        if not isinstance(error, SceneGenError):
            raise
        raise UserError(str(error)) from error


def _spelled_alike(error: click.UsageError) -> str:
    """Return the choices of an option that are spelled like the wrong one, in words."""
    from scenegen.common.names import did_you_mean

    kind = getattr(getattr(error, "param", None), "type", None)
    wrong = re.match("'(.*?)'", error.message)
    if not isinstance(kind, click.Choice) or wrong is None:
        return ""
    hint = did_you_mean(wrong[1], kind.choices)
    return f" {hint[0].upper()}{hint[1:]}" if hint else ""


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    print_line(f"note: {message}", err=True)


def needs(who: str, packages: tuple[str, ...], extra: str) -> None:
    """Raise UserError where a package of one of this project's optional extras is missing."""
    missing = ", ".join(name for name in packages if importlib.util.find_spec(name) is None)
    if missing:
        raise UserError(f"{who} needs {missing}: pip install '.[{extra}]'")


def creation_command(program: str) -> str:
    """Return the command line for a file to record, without options that change no byte.

    A shell reads the words back as they were.
    """
    words, recorded = iter(sys.argv[1:]), [program]
    for word in words:
        if word == "--overwrite":
            continue
        if word in WITHOUT_EFFECT:
            next(words, None)
        elif word.partition("=")[0] not in WITHOUT_EFFECT:
            recorded.append(word)
    return shlex.join(recorded)
