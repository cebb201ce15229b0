"""What `wbmpc explain` prints: outcome, terms, active constraints and candidates, two plans side by side."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.table import Table
from rich.text import Text

from wbmpc.commands.tables import console, number, plain_table
from wbmpc.explain.explanation import Explanation, Variant
from wbmpc.explain.past import Past
from wbmpc.explain.stages import TITLES, StageTerms
from wbmpc.signals import SIDES

NEGLIGIBLE = 1e-9  # relative: what a first guess leaves of two solves of one problem


def print_notable(past: Past) -> None:
    """The plans at which something happened."""
    table = plain_table(f"{past.run.name}: plans worth a look, among {len(past.plans)}", "--at [s]>", "plan>", "what")
    for k, text in past.notable():
        firing = "bold" if text.startswith("stage 3 fired") else ""
        table.add_row(f"{past.plans[k].state.time:.3f}", str(k + 1), Text(text, style=firing))
    console().print(table)


def print_outcome(answer: Explanation) -> None:
    """What was decided, and what would have been."""
    recorded = answer.recorded.outcome()
    if answer.changed is None or answer.change is None:
        table = plain_table("outcome", "what", "recorded")
        _rows(table, recorded.items())
    else:
        changed = answer.changed.outcome()
        table = plain_table("outcome", "what", "recorded", f"with {', '.join(answer.change.words)}", "")
        _rows(table, ((name, text, changed[name], _differs(text != changed[name])) for name, text in recorded.items()))
    console().print(table)


def print_stages(answer: Explanation, most: int) -> None:
    """Terms and active constraints of every stage that was asked in either plan."""
    for key in TITLES:
        stages = [next((s for s in v.stages if s.stage == key), None) for v in _variants(answer)]
        asked = [stage for stage in stages if stage is not None]
        if not asked:
            continue
        out = console()
        same = len(asked) > 1 and _same(*asked)
        out.print(Text(f"{TITLES[key]}{', the same in both' if same else ''}", style="bold"))
        for stage, name in zip(stages, ("recorded", "changed"), strict=False):
            if stage is not None:
                out.print(Text(f" {name if len(stages) > 1 else 'solve'}: {_status(stage)}"))
        if same:
            out.print()
            continue
        _print_terms(stages)
        _print_active(stages, most)


def print_candidates(answer: Explanation) -> None:
    """The candidates of stage 3, when it fired: what each costs, by part, and why it won or lost."""
    for variant, name in zip(_variants(answer), ("recorded", "changed"), strict=False):
        if not variant.candidates:
            continue
        title = "stage 3: candidates" + (f", {name}" if answer.changed else "")
        parts = ("way>", "force>", "shift>", "reach [mm]>", "bound by", "friction [N]>", "beside", "why")
        table = plain_table(title, "patch", "hand", "cost>", *parts)
        for c in variant.candidates:
            costs = [number(cost) for cost in (c.cost, c.way_cost, c.force_cost, c.shift_cost)]
            margins = [f"{1e3 * c.reach_slack:+.1f}", c.reach_limit, number(c.friction_margin)]
            style = "bold green" if c.chosen else ""
            cells = (c.patch, SIDES[c.hand], *costs, *margins, ", ".join(c.beside), c.reason)
            table.add_row(*(Text(cell, style=style) for cell in cells))
        console().print(table)


def _same(one: StageTerms, other: StageTerms) -> bool:
    """Whether two solves differ by no more than their first guesses."""
    scale = NEGLIGIBLE * max(abs(one.objective), abs(other.objective))
    return one.costs.keys() == other.costs.keys() and all(
        abs(cost - other.costs[name]) <= scale for name, cost in one.costs.items()
    )


def _print_terms(stages: Sequence[StageTerms | None]) -> None:
    solved = [stage for stage in stages if stage is not None]
    table = plain_table(
        "",
        *("term", "cost>", "share>"),
        *(("changed>", "difference>") if len(stages) > 1 else ()),
    )
    first = stages[0]
    total = first.objective if first else 0.0
    names = list(dict.fromkeys(name for stage in solved for name in stage.costs))
    for name in [*names, "together"]:
        row, last = [name], name == "together"
        values = [None if stage is None else stage.objective if last else stage.costs.get(name) for stage in stages]
        row += (
            ["-", ""] if values[0] is None else [number(values[0]), f"{100 * values[0] / total:.1f} %" if total else ""]
        )
        if len(stages) > 1:
            row.append("-" if values[1] is None else number(values[1]))
            row.append(_difference(values, total))
        table.add_row(*(Text(cell, style="bold" if last else "") for cell in row))
    console().print(table)


def _print_active(stages: Sequence[StageTerms | None], most: int) -> None:
    held = [{(a.term, a.label): a for a in stage.active} if stage else {} for stage in stages]
    keys = list(dict.fromkeys(key for of in held for key in of))
    if not keys or not most:
        return
    keys.sort(key=lambda key: -max(abs(of[key].multiplier) for of in held if key in of))
    several = len(stages) > 1
    table = plain_table(
        "", "active constraint", "multiplier>", "exceeded by>", *(("changed>", "by>") if several else ())
    )
    for key in keys[:most]:
        cells = []
        for of in held:
            a = of.get(key)
            cells += ["-", "-"] if a is None else [number(abs(a.multiplier)), _excess(a.excess, a.unit)]
        table.add_row(f"{key[1]} ({key[0]})", *cells)
    if len(keys) > most:
        table.add_row(f"… and {len(keys) - most} more", *[""] * (4 if several else 2))
    console().print(table)


def _status(stage: StageTerms) -> str:
    text = f"{stage.status.name.lower()}, {stage.iterations} iteration{'' if stage.iterations == 1 else 's'}"
    if stage.optimum is None:
        return text
    text += f", stationary to {stage.optimum.residual:.0e}"
    worth = stage.optimum.worth
    return text if worth is None else f"{text}, a further ΔZ is worth {worth:.2f} of its price at most"


def _difference(values: Sequence[float | None], scale: float) -> str:
    if values[0] is None or values[1] is None:
        return ""
    difference = values[1] - values[0]
    return "=" if abs(difference) <= NEGLIGIBLE * abs(scale) else f"{difference:+.4g}"


def _excess(excess: float, unit: str) -> str:
    if excess == 0.0:
        return "hard"
    return f"{1e3 * abs(excess):.3g} mm" if unit == "m" else f"{abs(excess):.3g} {unit}"


def _differs(differs: bool) -> str:
    return "≠" if differs else "="


def _variants(answer: Explanation) -> list[Variant]:
    return [answer.recorded] if answer.changed is None else [answer.recorded, answer.changed]


def _rows(table: Table, rows: Iterable[Sequence[str]]) -> None:
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
