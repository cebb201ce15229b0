"""Writes docs/scenarios.md from the scenario files; `make pictures` makes its pictures and calls this."""

from __future__ import annotations

from pathlib import Path

from wbmpc.scenario import Scenario, load_scenario

DOCS = Path(__file__).parent
PAGE = DOCS / "scenarios.md"
INTRODUCTION = """\
# The scenarios

This page is made by `make pictures`, which runs every scenario and draws its recording: do not edit it. A single
recording is drawn by `wbmpc plot out/NAME.rrd`.

The strip shows the first and the last moment of the run and those that differ most in between. Blue arrows are contact
forces, the orange ball is the CoM, with its projection below. The figure shows what happened: with feet that stay, CoM
and ZMP against the support of the feet in time; with feet that step, footprints from above as well; where a contact was
asked for, the shift ΔZ that stage 2 asked and the forces of the hands. Green and violet shades are contacts of the
right and the left hand, red ones are pushes. How far each scenario goes before it fails: [limits.md](limits.md).
"Fig." numbers are those of the paper [M] of the [README](../README.md).
"""


def page(scenarios: list[Scenario]) -> str:
    """The whole page: what the paper has first, in its order, then the extensions by name."""
    ordered = sorted(scenarios, key=lambda s: (not s.paper, s.paper, s.name))
    return "\n".join([INTRODUCTION, *map(section, ordered)])


def section(scenario: Scenario) -> str:
    """One scenario."""
    name = scenario.name
    origin = f"{scenario.paper} of the paper." if scenario.paper else "An extension: the paper does not show it."
    lines = [
        f"## {name}",
        "",
        f"*{origin}* {' '.join(scenario.description.split())} ([{name}.yaml](../scenarios/{scenario.source.name}))",
        "",
        f"![{name}: key moments side by side](pictures/{name}_strip.webp)",
        "",
        f"![{name}: its curves](pictures/{name}_plot.webp)",
        "",
    ]
    for counterfactual, declared in scenario.counterfactuals.items():
        outcome = "passes" if declared.expect == "pass" else "fails"
        if declared.failing:
            outcome += " " + ", ".join(f"`{check}`" for check in declared.failing)
        lines.append(f"- `{counterfactual}` {outcome}. {' '.join(declared.description.split())}".rstrip())
    return "\n".join([*lines, ""] if scenario.counterfactuals else lines)


def shipped() -> list[Scenario]:
    """All scenarios of the repository."""
    return [load_scenario(path) for path in sorted((DOCS.parent / "scenarios").glob("*.yaml"))]


if __name__ == "__main__":
    PAGE.write_text(page(shipped()), encoding="utf-8")
    print(PAGE)
