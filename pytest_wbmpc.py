"""pytest plugin: `pytest scenarios/ --wbmpc` runs scenario files as tests.

Loaded by every pytest of an environment that has wbmpc, so nothing of wbmpc is imported here before `--wbmpc` is given
(`import wbmpc` alone already sets the number of BLAS threads). All else is in `wbmpc.commands.pytest_scenarios`.
"""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options of scenario files; see docs/ci.md."""
    group = parser.getgroup("wbmpc", "scenarios of whole-body MPC (wbmpc)")
    group.addoption("--wbmpc", action="store_true", help="Collect scenario files (.yaml, .yml) and run them.")
    group.addoption("--wbmpc-out", metavar="DIR", default="out", help="Folder of the results [out].")
    group.addoption(
        "--wbmpc-set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="Set a key of every scenario by its dotted path, e.g. duration=5; repeatable.",
    )
    group.addoption("--wbmpc-no-record", action="store_true", help="Write no .rrd files.")


def pytest_configure(config: pytest.Config) -> None:
    """Load the rest, when it is asked for."""
    if config.getoption("--wbmpc"):
        from wbmpc.pool import one_thread_each

        one_thread_each()  # before anything imports numpy, as far as that is still possible
        from wbmpc.commands import pytest_scenarios

        pytest_scenarios.configure(config)
