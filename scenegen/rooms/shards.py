"""Make a set of rooms in shards, here or on a cluster, and the file that shows them as one."""

import time
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenegen.description.specs import Fingerprint
from scenegen.files.cluster import Cluster
from scenegen.files.content import seal
from scenegen.files.making import Task, check_shared, complete_set, record_file
from scenegen.files.manifest import FORMAT, Manifest, ShardRecord, manifest_path
from scenegen.files.new_file import check_writable
from scenegen.files.row_file import new_file, writer_name
from scenegen.files.shards import Shard, cut, opened, shard_name
from scenegen.files.table import PackedRows
from scenegen.files.virtual import write_list, write_virtual
from scenegen.layout import FORMAT_NAME, FORMAT_VERSION, TRUTH_DIGEST, columns
from scenegen.rooms.reader import truth_digest
from scenegen.rooms.render import Work
from scenegen.rooms.writer import create_rooms, root_attributes


@dataclass(frozen=True, eq=False)
class _Shards:
    """What is made of the scenes of a set; any process can make any of its shards.

    Attributes:
        path: the file that shows all of them.
        attributes: root attributes that are not of the request.
        asked: the manifest of the request.
    """

    path: Path
    work: Work
    attributes: dict[str, str]
    asked: Manifest

    def write(
        self, task: Task, made: Generator[PackedRows], progress: Callable[[int], Any]
    ) -> ShardRecord:
        """Write a shard with the next rows of `made`."""
        started, place = time.monotonic(), self.path.with_name(task.names[0])
        rows = task.items * len(self.work.spec.views)
        with create_rooms(
            place, self.work.spec, task.items, compression=self.work.compression, overwrite=True,
            attributes=self.attributes, is_shard=place != self.path,
        ) as writer:  # fmt: skip
            while writer.table.rows < rows:
                some = next(made)
                writer.extend(some)
                progress(some.count)
        return record_file(place, task, rows, started)

    def here(self, tasks: Sequence[Task], progress: Callable[[int], Any]) -> Generator[ShardRecord]:
        """Make shards by the processes of this machine."""
        with closing(self.work.in_order(map(_scenes, tasks))) as made:
            for task in tasks:
                yield self.write(task, made, progress)
            next(made, None)  # there is none; so workers end by themselves

    def elsewhere(self, task: Task) -> tuple[ShardRecord, dict[str, str]]:
        """Make a shard, and tell why models were refused; to be called by a worker of a cluster."""
        check_shared(manifest_path(self.path), self.asked)
        work = self.work.on_cluster()
        with closing(work.rows(_scenes(task))) as made:
            return self.write(task, made, lambda done: None), self.work.objects.problems

    def join(self, manifest: Manifest) -> None:
        """Write the file that shows all shards as one; it tells what one file would tell."""
        if manifest.shards[0].file == self.path.name:
            return
        spec, folder = self.work.spec, self.path.parent
        shards = [Shard(one.file, one.rows, one.content_digest) for one in manifest.shards]
        views, fingerprint = len(spec.views), Fingerprint(spec)
        for shard in shards:
            with opened(folder / shard.file) as file:
                for text in file["scene"][::views]:
                    fingerprint.add(text)
        axes = {column.name: column.axes or () for column in columns(spec)}
        with new_file(self.path, overwrite=True) as file:
            file.attrs.update({**root_attributes(spec), **self.attributes})
            write_virtual(file, folder, shards, axes)
            write_list(file, shards)
            file.attrs["fingerprint"] = fingerprint.hex
            file.attrs[TRUTH_DIGEST] = truth_digest(file)
            seal(file)


def make_shards(
    path: Path,
    work: Work,
    count: int,
    size: int,
    attributes: dict[str, str],
    *,
    cluster: Cluster | None = None,
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> None:
    """Render scenes 0 .. count - 1 to shards of `size` scenes beside `path`, the file of the set.

    Where one shard would hold all of them, `path` is a whole file instead.

    Args:
        cluster: whose workers make the shards; None for processes of this machine.

    Raises as `complete_set`.
    """
    check_writable(path, overwrite=True)
    path = path if cluster is None else path.absolute()  # workers are in other folders
    settings = {"compression": work.compression, "format_version": FORMAT_VERSION}
    settings |= {"writer": writer_name(), **attributes}
    command = settings.pop("creation_command")
    asked = Manifest(
        FORMAT, FORMAT_NAME, (path.name,), work.spec.to_json(), count, size,
        tuple(sorted(settings.items())), command, False, (),
    )  # fmt: skip
    scenes = cut(count, size)
    names = [shard_name(path, i, len(scenes)) for i in range(len(scenes))]
    tasks = [
        Task((name,), some.start, len(some))
        for name, some in zip(names if len(names) > 1 else [path.name], scenes, strict=True)
    ]

    def of_run(manifest: Manifest) -> _Shards:
        told = {**attributes, "creation_command": manifest.command}
        return _Shards(path, work, told, asked)

    def make(manifest: Manifest, missing: Sequence[Task]) -> Generator[list[ShardRecord]]:
        shards = of_run(manifest)
        if cluster is None:
            with closing(shards.here(missing, progress)) as records:
                yield from ([record] for record in records)
            return
        for record, problems in cluster.in_any_order(shards.elsewhere, missing):
            work.objects.problems.update(problems)
            progress(record.rows)
            yield [record]

    def join(manifest: Manifest) -> None:
        _Shards(path, work, {**attributes, "creation_command": manifest.command}, asked).join(
            manifest
        )

    complete_set(
        manifest_path(path), asked, tasks, make, join, overwrite=overwrite, progress=progress
    )


def _scenes(task: Task) -> range:
    return range(task.first, task.first + task.items)
