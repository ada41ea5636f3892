"""Paths on the command line: none is empty, and no file that a command writes is one it reads."""

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import click
from click.shell_completion import CompletionItem

from scenegen.common.errors import SpecError

Spelling = str | Path
OTHER_FORMATS = (
    ".png", ".jpg", ".jpeg", ".webp", ".gif", ".tif", ".tiff", ".exr", ".pdf", ".svg", ".html",
    ".npy", ".npz", ".json", ".csv", ".txt", ".parquet", ".zip",
)  # fmt: skip


@dataclass
class CommandPaths:
    """The paths that the running command has been given so far."""

    inputs: list[tuple[Path, tuple[str, ...]]] = field(default_factory=list)
    outputs: list[Path] = field(default_factory=list)
    folders: list[Path] = field(default_factory=list)  # to write to


class _Completed(click.ParamType):  # type: ignore[type-arg]
    """A path that shells complete."""

    completed = "file"

    def shell_complete(
        self, _ctx: click.Context, _param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Let the shell look for files, or folders."""
        return [CompletionItem(incomplete, type=self.completed)]


class InputPath(_Completed):
    """A file that is read, or a folder.

    Args:
        within: endings of the files that are read in a folder, at any depth.
        beside: which other files are read with one, such as a card of weights.
    """

    name = "path"

    def __init__(
        self,
        within: tuple[str, ...] = (),
        beside: Callable[[Path], Iterable[Path]] = lambda path: (),
    ) -> None:
        self.within, self.beside = within, beside

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Compare a path with the outputs that are known; keep it for those that follow."""
        paths = _command_paths(self, value, param, ctx)
        if ctx is not None and ctx.resilient_parsing:  # a shell asks how a line may go on
            return value
        read = [Path(value), *self.beside(Path(value))]
        paths.inputs += [(path, self.within) for path in read]
        refuse_inputs(paths.outputs, read, self.within)
        return value


class OutputFolder(_Completed):
    """A folder to write to.

    The command itself compares the files that it writes there with its inputs.
    """

    name = "path"
    completed = "dir"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Refuse an empty path, and one that is a file to be written."""
        paths = _command_paths(self, value, param, ctx)
        _refuse_twice(value, paths.outputs)
        paths.folders.append(Path(value))
        return value


class OutputPath(_Completed):
    """A file to write."""

    name = "path"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Compare a path with all others that are known; keep it for those that follow."""
        paths = _command_paths(self, value, param, ctx)
        _refuse_twice(value, [*paths.outputs, *paths.folders])
        paths.outputs.append(Path(value))
        for path, within in paths.inputs:
            refuse_inputs([value], [path], within)
        return value


class NewHdf5(OutputPath):
    """An HDF5 file to write, whose name must not promise another format."""

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Refuse the ending of another format, such as .png."""
        ending = Path(value).suffix.lower()
        if ending in OTHER_FORMATS:
            self.fail(f"found the ending {ending}, expected .h5: the file is HDF5", param, ctx)
        return super().convert(value, param, ctx)


def refuse_inputs(
    outputs: Iterable[Spelling], inputs: Iterable[Spelling], within: tuple[str, ...] = ()
) -> None:
    """Raise SpecError where an output is an input, however either is spelled or linked.

    With `within`, an input that is a folder stands for the files in it that end so.
    """
    written = [Path(output) for output in outputs]
    for path in map(Path, inputs):
        for output in written:
            if _same(output, path) or _inside(output, path, within):
                raise SpecError(
                    output, f"the same file as the input {path}", "an output that is not an input"
                )


def refuse_command_inputs(outputs: Iterable[Spelling]) -> None:
    """Raise as `refuse_inputs` where an output is one of the running command's own inputs."""
    for path, within in click.get_current_context().meta[__name__].inputs:
        refuse_inputs(outputs, [path], within)


def _command_paths(
    kind: click.ParamType,  # type: ignore[type-arg]
    value: str,
    param: click.Parameter | None,
    ctx: click.Context | None,
) -> CommandPaths:
    if not value:
        kind.fail("found an empty path, expected a name", param, ctx)
    paths: CommandPaths = (ctx.meta if ctx else {}).setdefault(__name__, CommandPaths())
    return paths


def _refuse_twice(output: str, others: Iterable[Path]) -> None:
    for other in others:
        if _same(Path(output), other):
            raise SpecError("outputs", f"{other} and {output}, one path", "different paths")


def _same(a: Path, b: Path) -> bool:
    try:
        return os.path.samefile(a, b)
    except OSError:  # one of them is not there
        return os.path.realpath(a) == os.path.realpath(b)


def _inside(output: Path, folder: Path, endings: tuple[str, ...]) -> bool:
    """Return whether a file is one of those in a folder that end so, or a hard link to one."""
    within = Path(os.path.realpath(folder)) in Path(os.path.realpath(output)).parents
    if within and output.suffix.lower() in endings:
        return True
    if not (endings and output.is_file() and output.stat().st_nlink > 1):
        return False
    there = (path for path in folder.rglob("*") if path.suffix.lower() in endings)
    return any(_same(output, path) for path in there)
