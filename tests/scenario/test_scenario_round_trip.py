"""Random valid scenarios survive being written and read back."""

from __future__ import annotations

from pathlib import Path

from base_scenario import edited, load, write
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from wbmpc.scenario import load_scenario, vary

NAMES = st.from_regex(r"\A[A-Za-z][A-Za-z0-9_]{0,12}\Z").filter(lambda name: name not in ("floor", "foot", "forearm"))


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    """Floats whose decimal text is not round: a lossy writer would show."""
    return st.floats(low, high, allow_subnormal=False)


def triples(low: float, high: float) -> st.SearchStrategy[list[float]]:
    return st.lists(numbers(low, high), min_size=3, max_size=3)


BOXES = st.fixed_dictionaries(
    {
        "kind": st.just("box"),
        "size": triples(0.01, 2.0),
        "position": st.lists(numbers(-3, 3), min_size=2, max_size=2),
    },
    optional={"bottom": numbers(0, 1), "yaw": numbers(-3, 3), "friction": numbers(0.1, 2), "present": st.booleans()}
    | {"walkable": st.booleans()},
)
TILES = st.fixed_dictionaries(
    {
        "position": st.lists(numbers(-3, 3), min_size=2, max_size=2),
        "count": st.lists(st.integers(1, 5), min_size=2, max_size=2),
        "size": st.lists(numbers(0.05, 0.5), min_size=2, max_size=2),
        "lowest": numbers(0.01, 0.02),
        "highest": numbers(0.02, 0.04),
    },
    optional={"friction": numbers(0.1, 2), "lowest_color": st.lists(numbers(0, 1), min_size=4, max_size=4)},
)
REACHES = st.builds(
    lambda target, start, travel, hand: {
        "kind": "reach",
        "hand": hand,
        "target": target,
        "start": start,
        "arrive_by": start + travel,
    },
    triples(-1, 1),
    numbers(0, 2),
    numbers(0.1, 2),
    st.sampled_from(["auto", "left", "right"]),
)
HEIGHTS = st.lists(numbers(0.1, 9.0), min_size=1, max_size=4, unique=True).map(
    lambda times: {"kind": "com_height", "waypoints": [{"time": t, "height": 0.2 + t / 100} for t in sorted(times)]}
)
STEP_AND_GO = st.tuples(
    st.fixed_dictionaries(
        {"kind": st.just("step"), "foot": st.sampled_from(["left", "right"])}
        | {"target": st.lists(numbers(-1, 1), min_size=2, max_size=2)},
        optional={"yaw": numbers(-3, 3), "start": numbers(0, 2), "duration": numbers(0.1, 2)},
    ),
    st.fixed_dictionaries(
        {"kind": st.just("go"), "target": st.lists(numbers(-1, 1), min_size=2, max_size=2), "start": numbers(4, 6)},
        optional={"swing_time": numbers(0.1, 2), "step_length": numbers(0.01, 0.2), "longest_step": numbers(0.26, 0.5)},
    ),
)
WALKS = st.lists(numbers(0.1, 9.0), min_size=1, max_size=4, unique=True).flatmap(
    lambda times: st.tuples(
        *(
            st.fixed_dictionaries(
                {"time": st.just(time), "velocity": st.lists(numbers(-0.2, 0.2), min_size=2, max_size=2)},
                optional={"yaw_rate": numbers(-1, 1)},
            )
            for time in sorted(times)
        )
    ).map(lambda commands: ({"kind": "walk", "commands": list(commands)},))
)
PUSHES = st.fixed_dictionaries(
    {"kind": st.just("impulse"), "body": st.sampled_from(["torso", "arm"]), "time": numbers(0, 9)}
    | {"impulse": triples(-3, 3)}
)
CHECKS = st.sampled_from([{"kind": "upright_at_end"}, {"kind": "torque_peak", "max": 0.9, "name": "on"}])


@st.composite
def documents(draw: st.DrawFn) -> dict[str, object]:
    objects = draw(st.dictionaries(NAMES, BOXES, max_size=3))
    patches = {}
    for name in draw(st.lists(NAMES, max_size=4, unique=True)) if objects else []:
        face = draw(st.sampled_from(["top", "bottom", "front", "back", "left", "right"]))
        patches[name] = {"on": draw(st.sampled_from(sorted(objects))), "face": face, "offset": [0.0, 0.004]}
    tasks = [draw(REACHES), draw(HEIGHTS), {"kind": "stand"}, *draw(STEP_AND_GO | WALKS)]
    return {
        "name": draw(st.from_regex(r"\A[A-Za-z0-9][A-Za-z0-9_-]{0,12}\Z")),
        "description": draw(st.text(max_size=30)),
        "robot": "tiny.xml",
        "seed": draw(st.integers(0, 2**63 - 1)),
        "duration": 10.0,
        "world": {"floor": {"friction": draw(numbers(0.1, 2))}, "objects": objects, "tiles": draw(st.none() | TILES)},
        "patches": patches,
        "tasks": draw(st.permutations(tasks))[: draw(st.integers(1, 5))],
        "disturbances": draw(st.lists(PUSHES, max_size=2)),
        "plant": {
            "friction": draw(st.none() | numbers(0.1, 2)),
            "body_mass_scale": {"arm": draw(numbers(0.5, 2))},
            "ground_error": draw(numbers(0, 0.009)),
        },
        "checks": [draw(CHECKS)],
    }


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(document=documents())
def test_written_scenario_reads_back_equal(tmp_path: Path, document: dict[str, object]) -> None:
    path = write(tmp_path, b"", name="drawn.yaml")
    yaml = YAML()
    yaml.allow_unicode, yaml.width = False, 1_000_000  # as `to_yaml` writes, and for the same reasons
    with path.open("w") as stream:
        yaml.dump(document, stream)
    scenario = load_scenario(path)
    _assert_holds(scenario.to_document(), document)
    effective = write(tmp_path, scenario.to_yaml(), name="effective.yaml")
    again = load_scenario(effective)
    assert again.to_document() == scenario.to_document()


def test_text_that_yaml_would_break_survives(tmp_path: Path) -> None:
    text = edited("name: base", 'name: base\ndescription: "\\x85 \\u2028 é: #\\n\\ton"')
    scenario = load(tmp_path, text)
    assert scenario.description == "\x85 \u2028 é: #\n\ton"
    assert load(tmp_path, scenario.to_yaml()).description == scenario.description


def test_a_long_text_of_escapes_gains_no_blanks(tmp_path: Path) -> None:
    """ruamel folds such a text at 80 columns, and reads the fold back as a blank more."""
    description = 12 * "\u0100" + " \u064a" + 12 * "\u0244" + "\u0648 \u064a"
    scenario = vary(load(tmp_path), {"description": description})
    assert load(tmp_path, scenario.to_yaml()).description == description


def _assert_holds(effective: object, written: object) -> None:
    """Every value written in the file is in the effective scenario, which has the defaults besides."""
    if isinstance(written, dict):
        assert isinstance(effective, dict)
        for key, value in written.items():
            _assert_holds(effective[key], value)
    elif isinstance(written, list):
        assert isinstance(effective, list)
        assert len(effective) == len(written)
        for left, right in zip(effective, written, strict=True):
            _assert_holds(left, right)
    else:
        assert effective == written
