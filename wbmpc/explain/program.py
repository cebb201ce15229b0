"""An optimisation problem in words: named sums of squares and bounds, what they cost and how they push at a point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls

from wbmpc.signals import Vector

RESTING = 1e-9  # a priced variable nearer to 0 is at 0, but for rounding
TOUCHING = 1e-7  # relative to the bound's size and 1: nearer than this a hard bound counts as active


@dataclass(frozen=True, slots=True)
class Term:
    """½ Σ w_i d_i², d_i the distance of row i of A x from [lower_i, upper_i]; equal bounds make a target.

    An infinite weight makes a row hard.
    """

    name: str
    rows: Vector  # (r, n) A
    lower: Vector  # (r,) in the row's unit
    upper: Vector  # (r,)
    weight: Vector  # (r,) [cost / unit²]
    unit: str
    labels: Sequence[str]  # (r,)

    @property
    def is_bound(self) -> bool:
        """Whether its rows say where something may be, and not where it should be."""
        return bool(np.any(self.lower != self.upper))

    def excess(self, x: Vector) -> Vector:
        """(r,) how far A x is above its upper bounds; negative: below the lower ones."""
        value = self.rows @ x
        return np.maximum(value - self.upper, 0.0) - np.maximum(self.lower - value, 0.0)

    def cost(self, x: Vector) -> float:
        """Of its soft rows."""
        soft = np.isfinite(self.weight)
        return float(0.5 * self.weight[soft] @ self.excess(x)[soft] ** 2)

    def push(self, x: Vector) -> Vector:
        """(r,) multipliers of the soft rows, w d: the cost's growth for every unit that the row's value grows."""
        return np.where(np.isfinite(self.weight), self.weight, 0.0) * self.excess(x)


@dataclass(frozen=True, slots=True)
class Active:
    """A constraint that holds the solution back."""

    term: str  # which constraints
    label: str  # which of them
    multiplier: float  # [cost / unit] what one unit more room would save
    excess: float  # [unit] by which a soft one is exceeded; 0 for a hard one
    unit: str


@dataclass(frozen=True, slots=True)
class Program:
    """minimise  Σ terms + priceᵀ |x| + constant  subject to  lower ≤ x ≤ upper  and the hard rows."""

    terms: Sequence[Term]
    variables: Sequence[str]  # (n,) names
    lower: Vector  # (n,)
    upper: Vector  # (n,)
    price: Vector  # (n,) [cost / unit] on |x|
    price_name: str = ""
    constants: dict[str, float] = field(default_factory=dict)

    def costs(self, x: Vector) -> dict[str, float]:
        """Every term at x (n,), constants included; they sum up to `objective`."""
        named = {term.name: 0.0 for term in self.terms}
        for term in self.terms:
            named[term.name] += term.cost(x)
        if self.price_name:
            named[self.price_name] = float(self.price @ np.abs(x))
        return named | self.constants

    def objective(self, x: Vector) -> float:
        """All terms together."""
        return sum(self.costs(x).values())

    def optimum(self, x: Vector) -> Optimum:
        """How the solution x (n,) is held: multipliers of everything that is active."""
        resting = (self.price > 0.0) & (np.abs(x) <= RESTING)  # |x| has a kink at 0: any slope up to the price will do
        slope = np.where(resting, 0.0, np.sign(x) * self.price)
        scale = 1e-12
        for term in self.terms:
            pull = term.rows.T @ term.push(x)
            scale = max(scale, float(np.abs(pull).max(initial=0.0)))
            slope += pull
        columns, found = self._hard(x)
        given = resting | (self.lower == self.upper)
        columns[given] = 0.0
        unheld = np.where(given, 0.0, slope)
        multipliers = nnls(columns, -unheld)[0] if columns.shape[1] else np.zeros(0)
        residual = unheld + columns @ multipliers
        active = [
            Active(term.name, label, float(push), float(excess), term.unit)
            for term in self.terms
            if term.is_bound
            for label, push, excess in zip(term.labels, term.push(x), term.excess(x), strict=True)
            if push != 0.0
        ]
        active += [
            Active(name, label, float(multiplier), 0.0, unit)
            for (name, label, unit), multiplier in zip(found, multipliers, strict=True)
            if multiplier > 0.0
        ]
        worth = np.abs(slope[resting]) / self.price[resting]
        return Optimum(
            active=tuple(sorted(active, key=lambda a: -abs(a.multiplier))),
            residual=float(np.abs(residual).max(initial=0.0) / scale),
            worth=float(worth.max()) if worth.size else None,
        )

    def _hard(self, x: Vector) -> tuple[Vector, list[tuple[str, str, str]]]:
        """Outward normals (n, a) of the hard bounds that x touches, and what they are called."""
        columns, found = [], []
        for side, bound in ((-1.0, self.lower), (1.0, self.upper)):
            for i in np.flatnonzero(_touches(side * (bound - x), bound) & (self.lower < self.upper)).tolist():
                columns.append(side * np.eye(x.size)[i])
                found.append(("bound", f"{self.variables[i]}, {'upper' if side > 0 else 'lower'} bound", ""))
        for term in self.terms:
            hard = np.isinf(term.weight)
            if not hard.any():
                continue
            value = term.rows @ x
            for side, bound in ((-1.0, term.lower), (1.0, term.upper)):
                for i in np.flatnonzero(hard & _touches(side * (bound - value), bound)).tolist():
                    columns.append(side * term.rows[i])
                    found.append((term.name, term.labels[i], term.unit))
        return (np.array(columns).T if columns else np.zeros((x.size, 0))), found


@dataclass(frozen=True, slots=True)
class Optimum:
    """The conditions of Karush, Kuhn and Tucker at a solution."""

    active: Sequence[Active]  # the strongest first
    residual: float  # what no multiplier explains of the slope, relative to the largest pull of a term
    worth: float | None  # largest slope of a priced variable that rests at 0, in prices: 1 and it would move


def term(
    name: str,
    rows: ArrayLike,
    target: ArrayLike | None = None,
    *,
    lower: ArrayLike = -np.inf,
    upper: ArrayLike = np.inf,
    weight: ArrayLike,
    unit: str,
    labels: Sequence[str] = (),
) -> Term:
    """A `Term` with scalars spread over its rows; `target` sets both bounds."""
    matrix = np.atleast_2d(np.asarray(rows, float))
    count = len(matrix)
    low, high = (lower, upper) if target is None else (target, target)
    lowest, highest, weights = (np.broadcast_to(np.asarray(values, float), (count,)) for values in (low, high, weight))
    return Term(name, matrix, lowest, highest, weights, unit, labels or [""] * count)


def facing(normal: Vector) -> str:
    """The name of an edge of a polygon, by its outward normal (2,) in world."""
    return f"edge facing ({normal[0]:+.2f}, {normal[1]:+.2f})"


def _touches(gap: Vector, bound: Vector) -> np.ndarray:
    return np.isfinite(bound) & (gap <= TOUCHING * np.maximum(1.0, np.abs(bound)))
