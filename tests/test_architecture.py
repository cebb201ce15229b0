"""The one-way order of the package, read from its imports; and what no file under wbmpc/ may hold."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "wbmpc"
FILES = sorted(PACKAGE.rglob("*.py"))
MAX_LINES = 300

BASE = {"record", "signals", "errors", "strict", "rotations", "jit"}
ROBOT = BASE | {"model_contract", "robot", "kinematics", "frame_terms"}
SETTINGS = BASE | {"settings", "scenario"}
CONTROLLER = ROBOT | SETTINGS | {"qp"}
RECORDS = BASE | {"timing", "columns", "recorder"}
LOOP = CONTROLLER | RECORDS | {"initial", "plant", "estimator", "planner", "tracker", "mailbox", "loop"}

# Component -> the components that it may import, itself included. signals <- robot <- {plant, estimator,
# qp <- planner, tracker} <- loop <- session <- commands; checks see signals, recorder and the settings of the checks.
ALLOWED = {
    "__init__": set(),
    "record": BASE,
    "signals": BASE,
    "errors": BASE,
    "strict": BASE,
    "rotations": BASE,
    "jit": BASE,
    "model_contract": ROBOT,
    "robot": ROBOT,
    "kinematics": ROBOT,
    "frame_terms": ROBOT,
    "settings": BASE | {"settings"},  # every settings.py: what a scenario may write for the package that it stands in
    "scenario": ROBOT | SETTINGS,
    "plant_kernels": BASE | {"plant_kernels"},
    "physics": {"physics"},
    "plant": ROBOT | SETTINGS | {"plant", "plant_kernels", "physics"},  # knows nothing of the controller
    "estimator": ROBOT | SETTINGS | {"estimator", "estimator_kernel"},
    "estimator_kernel": ROBOT | {"estimator_kernel"},
    "qp": BASE | {"qp"},
    "planner": CONTROLLER | {"planner"},  # knows nothing of the plant or of the tracker
    "tracker": CONTROLLER | {"tracker"},
    "timing": {"timing"},
    "columns": BASE | {"columns"},
    "recorder": RECORDS,
    "files": BASE | {"files"},
    "footage": RECORDS | {"footage"},
    "video": BASE | {"files", "video"},
    "render": RECORDS | {"files", "footage", "video", "render"},
    "rerun_sink": RECORDS | {"files", "footage", "rerun_sink"},
    "figures": RECORDS | {"checks", "files", "footage", "render", "rerun_sink", "figures"},
    "checks": RECORDS | ROBOT | {"settings", "checks"},
    "mailbox": BASE | {"planner", "mailbox"},
    "initial": ROBOT | SETTINGS | {"initial"},
    "loop": LOOP,
    "slots": {"slots"},
    "realtime": LOOP | {"slots", "realtime", "planner_process", "planner_thread"},
    "interact": LOOP | {"rerun_sink", "slots", "pool", "interact"},
    "planner_thread": LOOP | {"planner_thread"},
    "planner_process": LOOP | {"pool", "warm_up", "planner_thread", "planner_process"},
    "warm_up": LOOP | {"warm_up"},
    "facts": ROBOT | SETTINGS | {"checks", "facts"},
    "triage": RECORDS | ROBOT | SETTINGS | {"checks", "facts", "footage", "provenance", "rerun_sink", "triage"},
    "metrics": RECORDS | {"checks", "metrics"},
    "versions": {"versions"},
    "verdict": RECORDS | {"checks", "files", "triage", "versions", "verdict"},
    "golden": BASE | {"verdict", "golden"},
    "comparison": BASE | {"rerun_sink", "comparison"},
    "junit": {"checks", "files", "junit"},
    "counterfactuals": SETTINGS | {"counterfactuals"},
    "report": RECORDS
    | SETTINGS
    | {"checks", "footage", "render", "rerun_sink", "figures", "counterfactuals", "versions", "report"},
    "provenance": SETTINGS | {"versions", "provenance"},
    "session": LOOP
    | {
        "checks",
        "facts",
        "metrics",
        "verdict",
        "versions",
        "provenance",
        "rerun_sink",
        "realtime",
        "triage",
        "warm_up",
        "session",
    },
    "replay": LOOP | {"provenance", "rerun_sink", "replay"},
    "explain": LOOP | {"checks", "versions", "verdict", "provenance", "rerun_sink", "replay", "explain"},
    "parting": RECORDS | {"rerun_sink", "parting"},
    "branch": LOOP
    | {"checks", "verdict", "provenance", "rerun_sink", "replay", "explain", "parting", "session", "branch"},
    "sweep_journal": BASE | {"sweep_journal"},
    "pool": {"pool"},
    "sweep": SETTINGS | {"verdict", "session", "sweep_journal", "pool", "versions", "sweep"},
    "latency": SETTINGS | {"verdict", "session", "pool", "latency"},
    "doctor": ROBOT | {"pool", "realtime", "warm_up", "doctor"},
    "commands": None,  # anything
    "cli_options": {"cli_options"},
    "cli_again": {"commands", "scenario", "cli_options", "cli_again"},
    "cli_pictures": {"commands", "cli_options", "cli_pictures"},
    "cli": {"commands", "scenario", "versions", "pool", "cli_options", "cli_again", "cli_pictures", "cli"},
    "__main__": {"cli", "__main__"},
}


def component(module: str) -> str:
    """`wbmpc.planner.preview` -> planner; every settings module -> settings."""
    parts = module.split(".")
    if "settings" in parts:
        return "settings"
    return parts[1] if len(parts) > 1 else "__init__"


def imports(file: Path) -> set[str]:
    """Modules of this package that a file imports, inside functions too."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file.name}: relative import"
            module = node.module or ""
            # `from wbmpc.checks import settings` imports a module as well.
            for alias in node.names:
                inner = f"{module}.{alias.name}"
                path = ROOT / inner.replace(".", "/")
                found.add(inner if path.is_dir() or path.with_suffix(".py").is_file() else module)
    return {name for name in found if name.split(".")[0] == "wbmpc"}


def module_of(file: Path) -> str:
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(PACKAGE)))
def test_imports_go_one_way(file: Path) -> None:
    own = component(module_of(file))
    assert own in ALLOWED, f"{own} is new: say in ALLOWED what it may import"
    allowed = ALLOWED[own]
    if allowed is not None:
        against = sorted(name for name in imports(file) if component(name) not in allowed)
        assert not against, f"{own} may not import {', '.join(against)}"


def test_every_component_of_the_order_exists() -> None:
    there = {component(module_of(file)) for file in FILES}
    assert set(ALLOWED) <= there, f"no longer there: {', '.join(sorted(set(ALLOWED) - there))}"


def test_no_import_runs_in_a_circle() -> None:
    graph = {module_of(file): imports(file) for file in FILES}
    done: set[str] = set()

    def visit(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, " -> ".join([*path[path.index(module) :], module])
        if module in done:
            return
        for inner in graph.get(module, ()):
            visit(inner, (*path, module))
        done.add(module)

    for module in graph:
        visit(module, ())


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(PACKAGE)))
def test_no_scenario_is_named_and_no_file_is_long(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    # A scenario is data. Names that are also the kind of a task or check (stand, walk) mean that kind.
    kinds = {"stand", "reach", "walk", "step", "go"}
    names = {path.stem for path in (ROOT / "scenarios").glob("*.yaml")} - kinds
    literals = {n.value for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Constant) and isinstance(n.value, str)}
    assert not names & literals
    assert not [word for literal in literals for word in ("scenarios/", ".yaml") if literal.startswith(word)]
    assert text.count("\n") <= MAX_LINES
