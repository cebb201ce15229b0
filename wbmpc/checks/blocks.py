"""What is computed of every row, a block of rows after another: what it takes in between is that of one block."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbmpc.signals import Vector

BLOCK = 4096  # rows: temporaries of some hundred kilobytes, however long a run was


def by_blocks(function: Callable[..., NDArray[Any]], *columns: NDArray[Any]) -> NDArray[Any]:
    """What `function` answers for one block of the columns (n, ...) after another, put together as rows."""
    starts = range(0, max(1, len(columns[0])), BLOCK)
    return np.concatenate([function(*(column[k : k + BLOCK] for column in columns)) for k in starts])


def lengths(vectors: Vector) -> Vector:
    """(n, ...) lengths of `vectors` (n, ..., 3)."""
    return by_blocks(lambda block: np.linalg.norm(block, axis=-1), vectors)


def finite(*columns: NDArray[Any]) -> NDArray[np.bool_]:
    """(n,) whether all is finite in each row of the `columns` (n, w)."""
    return np.logical_and.reduce([by_blocks(lambda block: np.isfinite(block).all(axis=1), each) for each in columns])
