"""Every command answers bad input with exit code 2 and one line that says what is wrong; it leaves no file behind."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
import rerun as rr
from test_replay import pushed
from typer.testing import CliRunner, Result

from wbmpc.cli import app
from wbmpc.session import run_scenario

SCENARIOS = Path(__file__).parents[1] / "scenarios"
GARBAGE = bytes(range(256)) * 40
VERDICT = {"metrics": {"com_height_min": 0.2}, "checks": [{"name": "no_fall", "value": None}], "state_sha256": "ab"}
Call = Callable[..., str]

OF_A_SCENARIO = ("run {}", "interact {}", "sweep {} --draws 1", "latency {}")
OF_A_RECORDING = (
    "replay {}", "explain {}", "explain {} --at 0.1", "branch {} --at 0.1", "triage {}", "compare {} good.rrd",
    "compare good.rrd {}", "render {}", "screenshot {}", "plot {}", "report {}",
)  # fmt: skip
OF_A_ROBOT = ("replay good.rrd", "explain good.rrd", "branch good.rrd --at 0.1", "triage good.rrd")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one good file of each kind, and with bad ones."""
    folder = tmp_path_factory.mktemp("made")
    run_scenario(pushed(), name="good", recording=folder / "good.rrd")
    content = (folder / "good.rrd").read_bytes()
    shutil.copy(SCENARIOS / "reach.yaml", folder / "good.yaml")
    (folder / "verdict.json").write_text(json.dumps(VERDICT))
    for suffix in ("rrd", "yaml", "xml"):
        (folder / f"empty.{suffix}").write_bytes(b"")
        (folder / f"garbage.{suffix}").write_bytes(GARBAGE)
        (folder / f"folder.{suffix}").mkdir()
    (folder / "half.rrd").write_bytes(content[: len(content) // 2])
    (folder / "header.rrd").write_bytes(content[:12])
    middle = len(content) // 2
    (folder / "spoilt.rrd").write_bytes(content[:middle] + GARBAGE + content[middle + len(GARBAGE) :])
    with rr.RecordingStream("other") as other:
        other.save(folder / "foreign.rrd")
        other.set_time("time", duration=0.1)
        other.log("/state/qpos", rr.Scalars([1.0, 2.0]))
    other.disconnect()
    (folder / "wrong.xml").write_text("<mujoco/>")
    (folder / "void.json").write_bytes(b"")
    (folder / "noise.json").write_bytes(GARBAGE)
    (folder / "list.json").write_text("[]")
    (folder / "numbers.json").write_text(json.dumps(VERDICT | {"checks": [1]}))
    (folder / "words.json").write_text(json.dumps(VERDICT | {"metrics": {"com_height_min": "low"}}))
    (folder / "golden").mkdir()
    (folder / "golden" / "reach.json").write_bytes(GARBAGE)
    (folder / "taken" / "reach.json").mkdir(parents=True)
    return folder


@pytest.fixture
def call(made: Path, monkeypatch: pytest.MonkeyPatch) -> Call:
    """Give a command, get its one line; the folder is as before."""
    monkeypatch.chdir(made)

    def one_line(*words: str) -> str:
        before = {path for path in made.rglob("*") if path.is_file()}
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 2, result.output
        assert not {path for path in made.rglob("*") if path.is_file()} - before
        assert not result.stdout
        return the_line(result)

    return one_line


def the_line(result: Result) -> str:
    """Of a mistyped option what follows the two lines on how to call the command."""
    (line,) = (line for line in result.stderr.splitlines() if line and not line.startswith(("Usage: ", "Try '")))
    return line


@pytest.mark.parametrize("command", OF_A_RECORDING)
@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("absent.rrd", "no such "),
        ("empty.rrd", "not a readable recording"),
        ("garbage.rrd", "not a readable recording"),
        ("header.rrd", "not a readable recording"),
        ("spoilt.rrd", "not a readable recording"),
        ("foreign.rrd", "not a recording of wbmpc"),
        ("folder.rrd", "a folder, not a recording"),
    ],
)
def test_what_is_no_recording(call: Call, command: str, file: str, message: str) -> None:
    line = call(*command.format(file).split())
    assert file in line
    assert ("no run in" if command.startswith("report") and file.startswith("folder") else message) in line
    assert "/tmp" not in line  # of a copy that the user does not know


@pytest.mark.parametrize("command", [c for c in OF_A_RECORDING if not c.startswith(("render", "plot", "rep", "scr"))])
def test_half_a_recording_without_a_whole_block(call: Call, command: str) -> None:
    assert call(*command.format("half.rrd").split()).startswith("half.rrd: no tick is in it")


@pytest.mark.parametrize("command", ["plot half.rrd --frames 0 --out {}", "report half.rrd --out {}/page.html"])
def test_half_a_recording_is_shown_as_far_as_it_goes(made: Path, tmp_path: Path, command: str) -> None:
    words = command.replace("half.rrd", str(made / "half.rrd")).format(tmp_path).split()
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    assert list(tmp_path.iterdir())


@pytest.mark.parametrize("command", [*OF_A_SCENARIO, "validate {}"])
@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("absent.yaml", "absent.yaml: no such file"),
        ("empty.yaml", "empty.yaml:1:1: the file is empty"),
        ("garbage.yaml", "garbage.yaml:2:118: not a UTF-8 text file"),
        ("folder.yaml", "folder.yaml: is a directory"),
        ("good.rrd", "good.rrd: is too large for a scenario"),
    ],
)
def test_what_is_no_scenario(call: Call, command: str, file: str, message: str) -> None:
    assert call(*command.format(file).split()).startswith(message)


@pytest.mark.parametrize("command", OF_A_SCENARIO)
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("duration", "--set duration: expected KEY=VALUE"),
        ("=3", "--set =3: expected KEY=VALUE"),
        ("duration=[1", "--set duration: not valid YAML"),
        ("duration=long", "--set duration: expected a number, got 'long'"),
        ("duration=.nan", "--set duration: must be a finite number"),
        ("duration=-1", "--set duration: must be "),
        ("seed=1.5", "--set seed: expected a whole number"),
        ("planner.horizon_stepz=9", "--set planner.horizon_stepz: unknown key, did you mean 'horizon_step'?"),
        ("tasks.9.hold=1", "--set tasks.9.hold: '9' is not an index in tasks"),
        ("tasks.0.kind=fly", "--set tasks.0.kind: unknown kind 'fly', choices: "),
        ("checks.0.kind=luck", "--set checks.0.kind: unknown kind 'luck', choices: "),
        ("patches.none.friction=1", "--set patches.none.friction: unknown key "),
    ],
)
def test_changes_that_a_scenario_does_not_take(call: Call, command: str, change: str, message: str) -> None:
    assert call(*command.format("good.yaml").split(), "--set", change).startswith(message)


@pytest.mark.parametrize("command", ["explain", "branch"])
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("planner", "--set planner: expected KEY=VALUE"),
        ("planner.contact_stage=maybe", "--set planner.contact_stage: expected true or false"),
        ("planner.whole_body.jerk_cost=.nan", "--set planner.whole_body.jerk_cost: must be a finite number"),
        (
            "planner.whole_body.jerk_kost=1",
            "--set planner.whole_body.jerk_kost: unknown key, did you mean 'jerk_cost'?",
        ),
        ("planner.horizon_steps=3", "--set planner.horizon_steps: cannot change in the middle of a run; what can: "),
        ("duration=9", "--set duration: cannot change in the middle of a run; what can: "),
        ("forbid=table", "--set forbid: unknown patch 'table' (the scenario has none)"),
        ("forbid=3", "--set forbid: unknown patch '3'"),
    ],
)
def test_changes_that_a_run_does_not_take(call: Call, command: str, change: str, message: str) -> None:
    assert call(command, "good.rrd", "--at", "0.1", "--set", change).startswith(message)


@pytest.mark.parametrize(
    "command",
    [
        "explain good.rrd --at", "branch good.rrd --at", "render good.rrd --time", "render good.rrd --out a.gif --from",
        "render good.rrd --out a.gif --to",
    ],
)  # fmt: skip
@pytest.mark.parametrize("time", ["nan", "inf", "-inf", "-1", "0.6", "1e300", "soon"])
def test_times_that_are_not_in_the_run(call: Call, command: str, time: str) -> None:
    line = call(*command.split(), time)
    option = command.rpartition(" ")[2]
    of_an_option = line.startswith((f"Error: Invalid value for '{option}'", f"{option} "))
    of_an_animation = line.startswith("an animation from ") and line.endswith("its end is not after its start")
    assert of_an_option or of_an_animation or (line.startswith("no sample at") and "the run goes from 0 to" in line)


@pytest.mark.parametrize(
    "command",
    [
        "run good.yaml --jobs 0", "run good.yaml --seed -1", "run good.yaml --seed many",
        "interact good.yaml --duration 0", "interact good.yaml --duration nan", "interact good.yaml --pace 0",
        "interact good.yaml --pace nan", "sweep good.yaml --draws 0", "sweep good.yaml --draws 1 --jobs 0",
        "sweep good.yaml --draws 1 --min-rate nan", "sweep good.yaml --draws 1 --min-rate 2",
        "latency good.yaml --jobs 0", "latency good.yaml --delay nan", "latency good.yaml --delay -1",
        "explain good.rrd --most -1", "compare good.rrd good.rrd --atol nan", "compare good.rrd good.rrd --rtol inf",
        "render good.rrd --fps 0", "render good.rrd --fps nan", "render good.rrd --speed 0",
        "render good.rrd --width 0", "render good.rrd --height 99999", "render good.rrd --distance 0",
        "render good.rrd --distance inf", "render good.rrd --azimuth nan", "render good.rrd --elevation inf",
        "screenshot good.rrd --width 0", "screenshot good.rrd --time nan", "plot good.rrd --frames -1",
        "plot good.rrd --width 0", "plot good.rrd --azimuth nan", "plot good.rrd --distance inf",
        "report good.rrd --jobs 0",
    ],
)  # fmt: skip
def test_numbers_out_of_range(call: Call, command: str) -> None:
    option = command.split()[-2]
    assert call(*command.split()).startswith(f"Error: Invalid value for '{option}': ")


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("latency good.yaml --delay inf", "--delay inf: not a multiple of the timestep"),
        ("latency good.yaml --delay 1e9", "--delay 1e+09: loop.planner_delay must be ≤ 1"),
        ("latency good.yaml --format bmp", "--format bmp: choose one of png, "),
        ("plot good.rrd --format bmp", "--format bmp: choose one of png, "),
        ("plot good.rrd good.rrd", "two recordings are named 'good'"),
        ("render good.rrd --out a.bmp", "a.bmp: unknown kind of picture; choose one of .png, "),
        ("render good.rrd --out a.gif --fps 90", "a .gif has at most 50 frames a second"),
        ("screenshot good.rrd --out a.bmp", "a.bmp: unknown kind of picture; choose one of .png, "),
        ("sweep stand --draws 1", "stand: no such file"),
        ("run good.yaml --realtime --jobs 2", "--jobs 2: real-time runs share no cores"),
        ("run good.yaml --view-at here:99999", "--view-at here:99999: not an address; allowed: "),
        ("run good.yaml --golden absent", "no golden result absent/reach.json"),
        ("run good.yaml --golden golden", "golden/reach.json: not a golden result: "),
        ("explain good.rrd --set planner.contact_stage=false", "--set: say with --at which plan"),
        ("explain good.rrd --json a.json", "--json: say with --at which plan"),
        ("doctor --robot absent", "no robot 'absent' in models/, choices: surena_mini"),
        ("doctor --robot absent.xml", "absent.xml: no such robot model"),
        ("doctor --robot folder.xml", "folder.xml: no such robot model"),
        ("compare good.yaml good.rrd", "good.yaml: neither NAME.json nor NAME.rrd"),
        ("compare absent.json verdict.json", "absent.json: "),
        ("compare verdict.json taken/reach.json", "taken/reach.json: "),
        ("compare void.json verdict.json", "void.json: not JSON: "),
        ("compare noise.json verdict.json", "noise.json: not JSON: "),
        ("compare list.json verdict.json", "list.json: not the verdict of a run"),
        ("compare verdict.json numbers.json", "numbers.json: not the verdict of a run"),
        ("compare words.json verdict.json", "words.json: not the verdict of a run"),
        ("report absent.json", "no such file or folder: absent.json"),
        ("report list.json", "list.json: not the verdict of a run"),
        ("report good.yaml", "good.yaml: neither a recording (.rrd), nor a verdict (.json)"),
        ("report golden", "golden/reach.json: line 1, column 1: not JSON"),
    ],
)
def test_other_bad_words(call: Call, command: str, message: str) -> None:
    assert call(*command.split()).startswith(message)


@pytest.mark.parametrize("command", OF_A_ROBOT)
@pytest.mark.parametrize("robot", ["absent.xml", "folder.xml", "empty.xml", "garbage.xml", "wrong.xml"])
def test_a_robot_that_is_not_the_recorded_one(call: Call, command: str, robot: str) -> None:
    line = call(*command.split(), "--robot", robot)
    there = robot.startswith(("absent", "folder"))
    expected = f"no robot {robot}; say with --robot" if there else f"the robot {robot} is not the one of the run"
    assert line.startswith(f"good.rrd: {expected}")


@pytest.mark.parametrize(
    "command",
    [
        "run good.yaml --out {}", "run good.yaml --write-golden {}", "interact good.yaml --out {}",
        "sweep good.yaml --draws 1 --out {}", "latency good.yaml --out {}",
        "explain good.rrd --at 0.1 --json {}/a.json",
        "branch good.rrd --at 0.1 --out {}", "branch good.rrd --at 0.1 --no-record --out {}",
        "render good.rrd --out {}/a.png --width 16", "render good.rrd --out {}/a.gif --width 16 --to 0.1",
        "plot good.rrd --frames 0 --out {}", "report good.rrd --out {}/page.html", "screenshot good.rrd --out {}/a.png",
    ],
)  # fmt: skip
@pytest.mark.parametrize("folder", ["verdict.json", "verdict.json/deep"])
def test_a_folder_that_cannot_be_made(call: Call, command: str, folder: str) -> None:
    line = call(*command.format(folder).split())
    if "OpenGL" in line:
        pytest.skip("no OpenGL here")
    assert line.endswith(": verdict.json is no folder")
    assert folder in line


@pytest.mark.parametrize("command", ["run good.yaml --out taken", "report good.rrd --out folder.xml"])
def test_a_folder_in_the_place_of_a_file(call: Call, command: str) -> None:
    target = "taken/reach.json" if command.startswith("run") else "folder.xml"
    assert call(*command.split()) == f"cannot write {target}: it is a folder"
