"""Deliberately broken scenarios, tests/broken/: the first cause of each was written down before it was run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from wbmpc.cli import app
from wbmpc.rerun_sink.reading import Recording
from wbmpc.scenario import load_scenario
from wbmpc.session import run_scenario
from wbmpc.triage import Cause, Triage, triage
from wbmpc.triage.from_file import evidence_of

BROKEN = Path(__file__).parent / "broken"
# What each fault is, and between which times [s] it must be seen to begin: from what the file does to the robot.
EXPECTED = {
    "collision": ("collision", 0.5, 2.5),  # the sill is one step ahead
    "contact_not_made": ("contact not made", 0.5, 1.0),  # the push comes at 0.5 s
    "joint_limit": ("joint limit", 0.8, 2.1),  # on the way down
    "late_plan": ("late plan", 0.0, 0.2),  # from the first plan on
    "no_ground": ("contact not made", 2.0, 6.0),  # the first foot that is to land on the block
    "non_finite": ("non-finite", 0.5, 0.52),
    "push": ("push", 0.49, 0.51),
    "self_collision": ("self-collision", 0.5, 2.8),  # the foot in the air
    "slip": ("slip", 0.3, 2.5),
    "stage_infeasible": ("stage infeasible", 0.0, 1.5),
    "torque_saturation": ("torque saturation", 0.0, 0.5),  # before the crouch: standing is too much
    "unreachable": ("unreachable", 1.0, 3.0),
}
Answers = dict[str, tuple[Triage | None, Path]]


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> Answers:
    """What triage says of each, as the run ends, and the recording."""
    folder, found = tmp_path_factory.mktemp("broken"), {}
    for name in EXPECTED:
        path = folder / f"{name}.rrd"
        result = run_scenario(load_scenario(BROKEN / f"{name}.yaml"), name=name, recording=path)
        assert not result.verdict.passed, f"{name} is not broken"
        found[name] = (result.verdict.triage, path)
    return found


def test_at_least_nine_first_causes_of_ten_are_right(answers: Answers) -> None:
    def right(name: str) -> bool:
        answer, (cause, earliest, latest) = answers[name][0], EXPECTED[name]
        return answer is not None and answer.cause == cause and earliest <= answer.time <= latest

    wrong = {name: str(answers[name][0]) for name in EXPECTED if not right(name)}
    assert len(EXPECTED) >= 10
    assert {cause for cause, _, _ in EXPECTED.values()} == set(Cause) - {
        Cause.BALANCE_LOST
    }  # what is left when none is
    assert len(wrong) <= 0.1 * len(EXPECTED), wrong


def test_the_recording_tells_the_same(answers: Answers) -> None:
    """At a tenth of the rate: the same cause, a few samples later at most, and the viewer's text names it."""
    for name, (answer, path) in answers.items():
        recording = Recording(path)
        again = triage(*evidence_of(recording))
        assert answer is not None
        assert again is not None
        assert again.cause == answer.cause, name
        assert again.time == pytest.approx(answer.time, abs=0.1), name
        assert str(answer.cause) in recording.static("/verdict", "text")[0], name


def test_the_command_says_what_to_look_at_and_how_to_open_it(answers: Answers) -> None:
    path = answers["push"][1]
    result = CliRunner().invoke(app, ["triage", str(path)])
    assert result.exit_code == 0
    assert "first cause: push at 0.50 s" in result.output
    assert "look at: /world/disturbance" in result.output
    assert f"wbmpc render {path} --time 0.50" in result.output


def test_every_broken_file_is_expected() -> None:
    assert {path.stem for path in BROKEN.glob("*.yaml")} == set(EXPECTED)


def test_a_run_that_passes_has_no_cause(tmp_path: Path) -> None:
    changes: dict[str, Any] = {
        "duration": 1.0,
        "planner.horizon_steps": 5,
        "checks": [{"kind": "torque_peak", "max": 1}],
    }
    scenario = load_scenario(BROKEN.parents[1] / "scenarios" / "stand.yaml", changes)
    result = run_scenario(scenario, name="calm", recording=tmp_path / "calm.rrd")
    assert result.verdict.passed
    assert result.verdict.as_dict()["triage"] is None
    output = CliRunner().invoke(app, ["triage", str(tmp_path / "calm.rrd")]).output
    assert "every check passed" in output


def test_what_is_no_recording_is_one_line(tmp_path: Path) -> None:
    file = tmp_path / "x.rrd"
    file.write_text("no", encoding="utf-8")
    for words in ([str(file)], [str(tmp_path / "none.rrd")]):
        result = CliRunner().invoke(app, ["triage", *words])
        assert result.exit_code == 2
        assert len(result.stderr.strip().splitlines()) == 1
