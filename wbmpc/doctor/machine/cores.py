"""Cores, who else uses them, and how punctual they are."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from wbmpc.doctor.check import Answer
from wbmpc.pool import available_cores

WATCHED = 0.5  # [s]
NAPS, NAP = 300, 1e-3  # [s] a tick's length
PUNCTUAL = 0.5e-3  # [s] oversleep that a tick of 1 ms bears
MOST_STOLEN, MOST_BUSY = 0.02, 0.5
FIELDS = ("user", "nice", "system", "idle", "iowait", "irq", "softirq", "steal")  # of /proc/stat, see proc(5)


def cores(_: None = None) -> Answer:
    """Cores that this process may use: the affinity mask, and the quota of its control group."""
    allowed, quota = available_cores(), cgroup_quota(_cgroup_files())
    words = f"{allowed} of {os.cpu_count()}"
    words += "" if quota is None else f", a control group's quota of {quota:.2g}"
    usable = allowed if quota is None else min(allowed, quota)
    few = f"{words}: a real-time run has one for ticks, one for plans, and the system's own work"
    return Answer(words, (), [few] if usable < 2 else [])


def cgroup_quota(files: Mapping[str, str]) -> float | None:
    """Cores granted per period by Linux's control groups; None without a limit.

    Args:
        files: content by name, `cpu.max` (version 2) or `cpu.cfs_quota_us` and `cpu.cfs_period_us` (version 1).
    """
    if "cpu.max" in files:
        quota, period = (*files["cpu.max"].split(), "100000")[:2]
    else:
        quota, period = files.get("cpu.cfs_quota_us", "-1").strip(), files.get("cpu.cfs_period_us", "100000").strip()
    if quota == "max" or float(quota) <= 0:
        return None
    return float(quota) / float(period)


def load(_: None = None) -> Answer:
    """What others take of the cores: processes of this machine, and the hypervisor's other guests."""
    try:
        before = Path("/proc/stat").read_text(encoding="ascii")
        time.sleep(WATCHED)
        return shared(before, Path("/proc/stat").read_text(encoding="ascii"), _hypervisor())
    except OSError:
        return Answer("not known without /proc/stat")


def shared(before: str, after: str, hypervisor: bool) -> Answer:
    """Shares between two readings of /proc/stat."""
    spent = {name: b - a for name, a, b in zip(FIELDS, _times(before), _times(after), strict=True)}
    total = max(sum(spent.values()), 1)
    stolen = spent["steal"] / total
    busy = sum(spent[name] for name in FIELDS if name not in ("idle", "iowait", "steal")) / total
    words = f"{busy:.0%} busy, {stolen:.0%} stolen" + (" (a virtual machine)" if hypervisor else "")
    warnings = []
    if stolen > MOST_STOLEN:
        warnings.append(f"{words}: another guest has the cores that long")
    elif busy > MOST_BUSY:
        warnings.append(f"{words}: other programs are at work")
    return Answer(words, (), warnings)


def frequency(_: None = None) -> Answer:
    """The governor of the cores' clock."""
    governors = {
        path.read_text().strip() for path in Path("/sys/devices/system/cpu").glob("cpu*/cpufreq/scaling_governor")
    }
    if not governors:
        return Answer("the clock is not this system's business")
    words = f"governor {', '.join(sorted(governors))}"
    return Answer(words, (), [f"{words}: ticks after a pause are slow"] if governors - {"performance"} else [])


def priority(_: None = None) -> Answer:
    """Whether the system grants the ticks' thread real-time priority."""
    import resource

    from wbmpc.realtime import PRIORITY, ahead_of_others

    with ahead_of_others() as granted:
        pass
    limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[0] if hasattr(resource, "RLIMIT_RTPRIO") else 0
    if granted:
        return Answer(f"SCHED_FIFO {PRIORITY} is granted")
    return Answer("", (), [f"SCHED_FIFO {PRIORITY} is refused (RLIMIT_RTPRIO {limit}): ticks wait for other programs"])


def punctuality(_: None = None) -> Answer:
    """By how much a sleep of one tick is too long, with the priority that the ticks' thread would have."""
    from wbmpc.realtime import ahead_of_others

    late = np.empty(NAPS)
    with ahead_of_others():
        for k in range(NAPS):
            began = time.perf_counter()
            time.sleep(NAP)
            late[k] = time.perf_counter() - began - NAP
    return punctual(late)


def punctual(late: np.ndarray) -> Answer:
    """Judges the lateness (n,) [s] of wake-ups."""
    p50, p99, most = 1e6 * np.percentile(late, [50, 99, 100])
    words = f"a sleep of {1e3 * NAP:g} ms lasts longer by p50 {p50:.0f}, p99 {p99:.0f}, at most {most:.0f} µs"
    return Answer(words, (), [f"{words}: ticks will be missed"] if p99 > 1e6 * PUNCTUAL else [])


def _times(stat: str) -> list[int]:
    """The first line's clock ticks: all cores together."""
    words = stat.splitlines()[0].split()[1 : 1 + len(FIELDS)]
    return [int(word) for word in words] + [0] * (len(FIELDS) - len(words))


def _hypervisor() -> bool:
    return " hypervisor" in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")


def _cgroup_files() -> dict[str, str]:
    found = {}
    for root in ("/sys/fs/cgroup", "/sys/fs/cgroup/cpu"):
        for name in ("cpu.max", "cpu.cfs_quota_us", "cpu.cfs_period_us"):
            path = Path(root, name)
            if path.is_file():
                found[name] = path.read_text(encoding="ascii")
    return found
