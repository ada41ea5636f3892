"""Tasks of workers, in a module that takes no time to import: each process imports it again."""

import os
import signal
import time

from scenegen.common.errors import SceneGenError
from scenegen.files.sets.making import check_shared


def slow_square(folder, number):
    """Return a square, and leave the number of the process that was asked."""
    (folder / str(number)).write_text(str(os.getpid()))
    time.sleep(0.1)
    return number * number


def crash(folder, always, number):
    """Return the number; at 3 a signal ends the process, once or always."""
    if number == 3 and (always or not (folder / "tried").exists()):
        (folder / "tried").touch()
        os.kill(os.getpid(), signal.SIGSEGV)
    return number


def fail(number):
    raise SceneGenError("row 3", "a task that fails", "one that does not", "mend it")


def versions_of(release):
    return {"mitsuba_version": release, "process": "any"}


def version_by_process(main):
    """Return another version in every process but one."""
    return versions_of("3.9.1" if os.getpid() == main else "3.8.0")


def shared(task):
    check_shared(*task)
