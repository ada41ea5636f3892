"""What the kernel grants a process: version 1 and 2 of cgroups."""

import math
import os

from scenegen.common import cgroup as limits


def test_processors_are_those_of_the_cgroup(tmp_path):
    """Version 2 with a limit above and none here; version 1; a limit that is no number."""
    cgroup, root = tmp_path / "cgroup", tmp_path / "fs"
    for line, file, text, limit in [
        ("0::/pod/box", "pod/cpu.max", "150000 100000", 1.5),
        ("0::/pod/box", "pod/box/cpu.max", "max 100000", 1.5),
        ("0::/", "cpu.max", "50000 100000", 0.5),
        ("4:memory:/x\n3:cpu,cpuacct:/box", "cpu/box/cpu.cfs_quota_us", "300000", math.inf),
        ("4:memory:/x\n3:cpu,cpuacct:/box", "cpu/box/cpu.cfs_period_us", "100000", 3.0),
        ("3:cpu:/", "cpu/cpu.cfs_quota_us", "-1", math.inf),
    ]:
        cgroup.write_text(line + "\n")
        (root / file).parent.mkdir(parents=True, exist_ok=True)
        (root / file).write_text(text + "\n")
        assert limits.processor_limit(root, cgroup) == limit
    assert limits.processor_limit(root, tmp_path / "none") == math.inf
    assert 1 <= limits.processors() <= os.cpu_count()


def test_kills_for_memory_are_counted(tmp_path):
    cgroup, root = tmp_path / "cgroup", tmp_path / "fs"
    for line, file, text, count in [
        ("0::/box", "box/memory.events", "low 0\noom 3\noom_kill 2\n", 2),
        ("0::/", "memory.events", "oom_kill 1\n", 1),
        ("4:memory:/box", "memory/memory.oom_control", "under_oom 0\noom_kill 4\n", 4),
        ("4:memory:/box", "memory/box/memory.oom_control", "under_oom 0\n", 4),
        ("3:cpu:/", "memory.events", "oom_kill 9\n", 0),
    ]:
        cgroup.write_text(line + "\n")
        (root / file).parent.mkdir(parents=True, exist_ok=True)
        (root / file).write_text(text)
        assert limits.oom_kills(root, cgroup) == count
    assert limits.oom_kills(root, tmp_path / "none") == 0
