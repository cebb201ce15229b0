"""The pool: every item gets its answer, whatever becomes of the processes."""

from __future__ import annotations

import multiprocessing
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from pool_work import interrupted, killed, raising, squared

from wbmpc.errors import WbmpcError
from wbmpc.pool import Died, available_cores, finished


@pytest.mark.parametrize("jobs", [1, 2, 9])
def test_every_item_has_its_result(jobs: int) -> None:
    results = dict(finished(squared, [3, 4, 5, 6], jobs=jobs))
    assert {index: square for index, (square, _) in results.items()} == {0: 9, 1: 16, 2: 25, 3: 36}
    assert not multiprocessing.active_children()


def test_no_items_are_no_work() -> None:
    assert list(finished(squared, [], jobs=4)) == []


def test_results_come_as_they_finish_and_begin_in_order() -> None:
    places = [index for index, _ in finished(squared, [4, 1, 2, 3], jobs=2)]
    assert places == [1, 2, 3, 0]


def test_a_worker_has_one_blas_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        monkeypatch.setenv(name, "8")
    for _, result in finished(squared, [1, 2], jobs=2):
        assert not isinstance(result, Died)
        assert set(result[1].values()) == {"1"}


def test_a_death_costs_one_item_and_says_how() -> None:
    results = dict(finished(killed, [1, 2, 3, 5, 4, -1, 6], jobs=2))
    assert [results[k] for k in (1, 4, 6)] == [2, 4, 6]
    reasons = [results[k].reason for k in (0, 2, 3, 5)]  # type: ignore[union-attr]
    assert reasons[:3] == ["its process was killed by SIGKILL (out of memory?)"] * 3
    assert reasons[3] == "its process ended with exit code 7"


def test_workers_leave_ctrl_c_to_the_parent() -> None:
    assert sorted(finished(interrupted, [7, 8], jobs=2)) == [(0, 7), (1, 8)]


def test_the_very_first_worker_of_a_program_does_so_too() -> None:
    """Python's resource tracker comes up with it, and unblocks Ctrl-C."""
    names = "from pool_work import interrupted; from wbmpc.pool import finished"
    text = f"{names}; print(sorted(finished(interrupted, [7, 8], jobs=2)))"
    done = subprocess.run([sys.executable, "-c", text], cwd=Path(__file__).parent, capture_output=True, text=True)
    assert (done.returncode, done.stderr, done.stdout) == (0, "", "[(0, 7), (1, 8)]\n")


def test_an_exception_comes_back_and_ends_all_workers() -> None:
    with pytest.raises(WbmpcError, match="no such robot"):
        list(finished(raising, [0, 1, 2, 3], jobs=2))
    assert not multiprocessing.active_children()


def test_closing_early_ends_all_workers() -> None:
    with closing(finished(squared, [1, 4, 4, 4], jobs=2)) as results:
        assert next(results)[0] == 0
        assert multiprocessing.active_children()
    assert not multiprocessing.active_children()


def test_there_is_a_core_to_work_on() -> None:
    assert available_cores() >= 1
