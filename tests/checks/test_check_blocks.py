"""Columns in blocks: the numbers are those of all rows at once, to the bit."""

from __future__ import annotations

import numpy as np
import pytest

from wbmpc.checks.blocks import BLOCK, by_blocks, finite, lengths
from wbmpc.checks.hold import best_hold
from wbmpc.signals import Vector


@pytest.mark.parametrize("rows", [0, 1, BLOCK, 2 * BLOCK + 1])
def test_blocks_are_all_rows(rows: int) -> None:
    values = np.random.default_rng(rows).normal(size=(rows, 2, 3))
    np.testing.assert_array_equal(lengths(values), np.linalg.norm(values, axis=2))
    sums = by_blocks(lambda a, b: a[:, 0] + b, values, values[:, 1])
    np.testing.assert_array_equal(sums, values[:, 0] + values[:, 1])


def test_no_more_rows_than_a_block_at_a_time() -> None:
    seen: list[int] = []

    def look(block: Vector) -> Vector:
        seen.append(len(block))
        return block

    by_blocks(look, np.zeros(BLOCK + 5))
    assert seen == [BLOCK, 5]


def test_a_row_is_finite_when_all_its_columns_are() -> None:
    first, second = np.zeros((BLOCK + 3, 2)), np.zeros((BLOCK + 3, 4))
    first[1, 0], second[BLOCK + 1, 3] = np.nan, np.inf
    np.testing.assert_array_equal(np.flatnonzero(~finite(first, second)), [1, BLOCK + 1])


@pytest.mark.parametrize("width", [1, 2, 7, 8, 100])
def test_best_hold_is_the_window_with_the_smallest_largest_error(width: int) -> None:
    error = np.random.default_rng(width).uniform(size=(100, 2))
    windows = [[error[k : k + width, hand].max() for hand in (0, 1)] for k in range(100 - width + 1)]
    start, hand = np.unravel_index(np.argmin(windows), np.shape(windows))
    assert best_hold(error, width) == (np.min(windows), hand, slice(start, start + width))


def test_a_window_with_a_nan_is_no_hold() -> None:
    error = np.ones((10, 2))
    error[:, 1], error[4, 0] = np.nan, np.nan
    assert best_hold(error, 5) == (1.0, 0, slice(5, 10))
