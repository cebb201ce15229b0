"""Every kind of the schema has a class, and every run is judged by the universal checks first."""

from __future__ import annotations

import typing

from synthetic import SyntheticRun

from wbmpc.checks import settings
from wbmpc.checks.registry import CHECKS, evaluate_checks


def test_every_kind_has_a_class() -> None:
    listed = typing.get_args(typing.get_args(settings.ScenarioCheck)[0])
    kinds = {typing.get_args(model.model_fields["kind"].annotation)[0] for model in listed}
    universal = settings.UniversalSettings()
    for field in settings.UniversalSettings.model_fields:
        assert getattr(universal, field).kind == field
        kinds.add(field)
    assert kinds == set(CHECKS)


def test_every_kind_can_be_evaluated_and_answers_under_its_name() -> None:
    run = SyntheticRun()
    run.plan(0.0)
    checks = [
        settings.Reach(kind="reach", max=0.01, hold=0.2),
        settings.Withdrawn(kind="withdrawn"),
        settings.ComBeyondToes(kind="com_beyond_toes", min=0.03, hold=0.2),
        settings.BraceForce(kind="brace_force", min=0.15, hold=0.2),
        settings.TorquePeak(kind="torque_peak", max=0.9),
        settings.ContactPatches(kind="contact_patches"),
        settings.ComHeight(kind="com_height", max=0.01),
        settings.UprightAtEnd(kind="upright_at_end"),
        settings.PushRecovery(kind="push_recovery", min_impulse=0.4),
        settings.Footsteps(kind="footsteps", min_count=1),
        settings.Travelled(kind="travelled", forward=(0.5, 0.6)),
        settings.Arrived(kind="arrived", tolerance=0.03),
        settings.Climbed(kind="climbed", min=0.1),
        settings.FootMoved(kind="foot_moved", foot="left", tolerance=0.02),
        settings.ComOutsideStance(kind="com_outside_stance", min=0.05),
        settings.ContactSequence(kind="contact_sequence", min_contacts=2),
        settings.BothHands(kind="both_hands", min=0.1, hold=0.2),
        settings.HandImpact(kind="hand_impact", max=1.5),
        settings.HandForceCaps(kind="hand_force_caps", margin=1.0),
        settings.Lifted(kind="lifted"),
        settings.ComDrop(kind="com_drop"),
        settings.ComInBand(kind="com_in_band"),
        settings.HandsFreeAtEnd(kind="hands_free_at_end"),
    ]
    results = evaluate_checks(run.context(), universal=settings.UniversalSettings(), checks=checks)
    assert [result.name for result in results] == list(CHECKS)
    universal = results[: len(settings.UniversalSettings.model_fields)]
    assert all(result.passed for result in universal)
    failing = {result.name for result in results if not result.passed}
    of_motion = {"footsteps", "travelled", "arrived", "climbed", "foot_moved", "com_outside_stance", "com_drop"}
    of_hands = {"reach", "brace_force", "contact_sequence", "both_hands", "lifted"}
    assert failing == {"com_beyond_toes", "com_height", "push_recovery"} | of_motion | of_hands


def test_names_are_kept_and_made_unique() -> None:
    checks = [settings.Withdrawn(kind="withdrawn"), settings.Withdrawn(kind="withdrawn")]
    checks.append(settings.Withdrawn(kind="withdrawn", name="home again"))
    results = evaluate_checks(SyntheticRun().context(), universal=settings.UniversalSettings(), checks=checks)
    assert [result.name for result in results[-3:]] == ["withdrawn", "withdrawn_2", "home again"]


def test_a_run_without_ticks_fails_everything() -> None:
    results = evaluate_checks(SyntheticRun(0).context(), universal=settings.UniversalSettings(), checks=[])
    assert results
    assert not any(result.passed for result in results)
