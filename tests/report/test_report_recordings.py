"""The page of recordings: whole, of a counterfactual, killed at any time; with and without pictures."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from base64 import b64decode
from io import BytesIO
from pathlib import Path

import wbmpc.render as pictures  # isort: skip  (before mujoco: it chooses the off-screen OpenGL)
import numpy as np
import pytest
from browser import a_tab
from PIL import Image
from report_case import Page
from short_run import ROOT, stand
from test_report_page import page_of, report, states

from wbmpc.errors import WbmpcError
from wbmpc.report.plots import SHEET, thinned
from wbmpc.rerun_sink.reading import Recording
from wbmpc.scenario import load_scenario
from wbmpc.session import RunResult, run_scenario

PUSH = {"kind": "impulse", "body": "torso", "time": 0.2, "duration": 0.1, "impulse": [0.5, 0.3, 0.0]}
ABSENT = {"set": {"planner.contact_stage": False}, "expect": "fail", "failing": ["completed"]}


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, RunResult]:
    """A short pushed run, its recording and its verdict."""
    folder = tmp_path_factory.mktemp("ran")
    scenario = stand(duration=0.6, disturbances=[PUSH], planner__horizon_steps=5, counterfactuals__absent=ABSENT)
    result = run_scenario(scenario, name="pushed", recording=folder / "pushed.rrd")
    result.verdict.write(folder / "pushed.json")
    return folder, result


@pytest.fixture
def folder(ran: tuple[Path, RunResult], tmp_path: Path) -> Path:
    """A copy of its files."""
    for file in ran[0].glob("pushed.*"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    return tmp_path


@pytest.fixture
def _no_gl(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise WbmpcError("no off-screen OpenGL")

    monkeypatch.setattr(pictures, "_render", refuse)


def test_pictures_are_in_the_page(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wbmpc.report.pictures.SIZE", 64)  # software draws slowly
    page = page_of(folder)
    if "No pictures: no off-screen OpenGL" in page.text:
        pytest.skip("no OpenGL")
    images = page.all("img")
    assert len(images) > 3
    (film,) = [found for found in images if "in motion" in found["alt"]]
    head, _, content = film["src"].partition(",")
    assert head == "data:image/webp;base64"
    with Image.open(BytesIO(b64decode(content))) as moving:
        assert (moving.size, moving.n_frames) == ((64, 64), 6)  # 0.59 s at 10 Hz
    still = page_of(folder, "--no-animation")
    assert len(still.all("img")) == len(images) - 1
    assert not still.all("figure", class_="film")


@pytest.mark.usefixtures("_no_gl")
def test_without_opengl_there_is_a_page_that_says_so(folder: Path) -> None:
    result = report(folder)
    assert (result.exit_code, result.stderr) == (0, "no pictures of 1 of 1 runs: no off-screen OpenGL\n")
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    assert "No pictures: no off-screen OpenGL" in page.text
    assert not page.all("img")
    assert len(page.all("figure", class_="plot")) >= 5


@pytest.mark.usefixtures("_no_gl")
def test_a_curve_of_the_page_is_the_recorders(folder: Path, ran: tuple[Path, RunResult]) -> None:
    page = page_of(folder)
    sheets = [found for found in page.all("svg") if found.get("aria-label") == "CoM velocity over time"]
    low, high = float(sheets[0]["data-low"]), float(sheets[0]["data-high"])
    (line,) = [found for found in page.all("polyline") if found["data-label"] == "CoM x"]
    x, y = np.array([list(map(float, pair.split(","))) for pair in line["points"].split()]).T
    recorder = ran[1].recorder
    motion = page.all("section", class_="motion")[0]
    times = float(motion["data-start"]) + x / SHEET * (float(motion["data-end"]) - float(motion["data-start"]))
    expected = np.interp(times, recorder.time, recorder.com_velocity[:, 0])
    np.testing.assert_allclose(high - y / SHEET * (high - low), expected, atol=0.02)
    assert np.abs(expected).max() > 0.05  # the push is in it


@pytest.mark.usefixtures("_no_gl")
def test_the_pointer_reads_the_curves_off_the_recorder(folder: Path, ran: tuple[Path, RunResult]) -> None:
    with a_tab() as tab:
        assert report(folder).exit_code == 0
        tab.open(folder / "report.html", width=1400)
        sheet = "document.querySelector('svg[aria-label=\"CoM velocity over time\"]')"
        tab.run(f"{sheet}.scrollIntoView({{block: 'center', behavior: 'instant'}})")
        left, top, width, height = tab.run(
            f"(({{left, top, width, height}}) => [left, top, width, height])({sheet}.getBoundingClientRect())"
        )
        tab.pointer(left + 0.5 * width, top + 0.5 * height)
        time, *rows = tab.run("document.querySelector('.readout').innerText").splitlines()
        assert tab.complaints == []
    recorder = ran[1].recorder
    (row,) = [row for row in rows if row.startswith("CoM x ")]
    expected = np.interp(float(time.removesuffix(" s")), recorder.time, recorder.com_velocity[:, 0])
    assert abs(expected) > 0.05  # the push is in it
    assert float(row.split()[2]) == pytest.approx(expected, abs=0.02)


@pytest.mark.usefixtures("_no_gl")
def test_what_happened_is_told(folder: Path) -> None:
    page = page_of(folder)
    titles = [found["title"] for found in page.all("span") if "title" in found]
    assert "push, 0.20 to 0.29 s" in titles
    assert sum(title.startswith("stance") for title in titles) >= 2
    assert f"wbmpc replay {folder / 'pushed.rrd'}" in page.text
    for word in ("completed", "momentum_balance", "state hash", "tracker", "stage2", "duration"):
        assert word in page.text


@pytest.mark.usefixtures("_no_gl")
def test_the_scenario_of_the_page_is_the_scenario(folder: Path) -> None:
    (link,) = [found for found in page_of(folder).all("a") if "download" in found]
    saved = folder / "saved.yaml"
    saved.write_bytes(b64decode(link["href"].partition("base64,")[2]))
    saved.write_text(saved.read_text().replace("duration: 0.6", "duration: 1.5"))  # files last one horizon at least
    assert load_scenario(saved).disturbances == stand(disturbances=[PUSH]).disturbances


@pytest.mark.usefixtures("_no_gl")
def test_a_recording_alone_has_its_verdict(folder: Path) -> None:
    both = page_of(folder)
    (folder / "pushed.json").unlink()
    alone = page_of(folder)
    assert states(alone) == states(both)
    assert len(alone.all("tr", class_="universal")) == len(both.all("tr", class_="universal")) == 8


@pytest.mark.usefixtures("_no_gl")
def test_a_verdict_of_another_run_is_noticed(folder: Path) -> None:
    document = json.loads((folder / "pushed.json").read_text())
    (folder / "pushed.json").write_text(json.dumps(document | {"state_sha256": "0" * 64}))
    assert "of different runs" in page_of(folder).text


@pytest.mark.usefixtures("_no_gl")
@pytest.mark.parametrize(("expect", "state"), [(ABSENT["failing"], "passed"), (["reach"], "failed")])
def test_a_counterfactual_passes_when_it_ends_as_declared(folder: Path, expect: list[str], state: str) -> None:
    """The run's YAML declares what must fail; the counterfactual's verdict says what did."""
    document = json.loads((folder / "pushed.json").read_text())
    for check in document["checks"]:
        check["passed"] = check["name"] not in expect
    document |= {"passed": False, "scenario": "pushed.absent"}
    (folder / "pushed.absent.json").write_text(json.dumps(document))
    page = page_of(folder)
    assert states(page)["pushed.absent"] == state
    assert ("fails completed, as declared" in page.text) == (state == "passed")


@pytest.mark.usefixtures("_no_gl")
def test_a_recording_cut_anywhere_is_taken(folder: Path) -> None:
    """Whatever a kill leaves, from the run's beginning on, makes a page that says whether it has the run's end."""
    (folder / "pushed.json").unlink()
    content = (folder / "pushed.rrd").read_bytes()
    seen = []
    for share in (1.0, 0.8, 0.6, 0.5, 0.4):
        (folder / "pushed.rrd").write_bytes(content[: int(share * len(content))])
        page = page_of(folder)
        seen.append(states(page)["pushed"])
        assert ("This run did not end" in page.text) == (seen[-1] == "unfinished")
        assert "Not readable" not in page.text
    assert seen[0] != "unfinished"
    assert seen[-1] == "unfinished"
    assert seen == sorted(seen)  # "failed" before "unfinished": what is cut off more knows no more


def test_thinning_keeps_every_extreme() -> None:
    y = np.random.default_rng(0).normal(size=20_000)
    x = np.arange(20_000.0)
    few, values = thinned(x, y)
    assert len(few) < 1000
    assert (values.max(), values.min()) == (y.max(), y.min())
    np.testing.assert_array_equal(values, y[few.astype(int)])
    assert np.all(np.diff(few) > 0)


def test_runs_killed_at_random_times_leave_readable_recordings(tmp_path: Path) -> None:
    """SIGKILL from the moment that the recording exists on. WBMPC_KILLS=20 for the full count."""
    kills = int(os.environ.get("WBMPC_KILLS", "2"))
    chance = random.Random(0)
    scenario = ROOT / "scenarios" / "stand.yaml"
    for number in range(kills):
        out = tmp_path / "out" / str(number)
        words = [sys.executable, "-m", "wbmpc", "run", str(scenario), "--set", "duration=60", "--out", str(out)]
        run = subprocess.Popen(words, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        recording = out / "stand.rrd"
        while not recording.exists():
            assert run.poll() is None, "the run ended by itself"
            time.sleep(1e-3)
        time.sleep(chance.choice([0.0, 0.01, 0.1, 1.0, 5.0]) * chance.random())
        run.send_signal(signal.SIGKILL)
        assert run.wait() == -signal.SIGKILL
        Recording(recording)  # readable
    result = report(tmp_path / "out", "--no-animation")
    assert result.exit_code == 0, result.output
    page = Page((tmp_path / "out" / "report.html").read_text())
    assert [found["data-state"] for found in page.all("details", class_="run")] == ["unfinished"] * kills
    assert "Not readable" not in page.text
