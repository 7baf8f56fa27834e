"""Files that grow and folders that fill: the numbers are those of `track` on the same data, for every kind."""

import io
import json
import shutil
import socket
import sys
import threading
import time
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import faintrack as ft
from faintrack.errors import InputError
from faintrack.kinds import kind_named
from faintrack.live.growing import GrowingWatch
from faintrack.live.lines import event_of
from faintrack.live.metrics import exposition
from faintrack.live.page.feed import LENGTH, greeting, scan_message
from faintrack.live.run import run
from tests.cli.calling import call
from tests.kinds.small import FILES, SCENARIOS
from tests.kinds.test_sweeps import scenario as sweeps_scenario

SIMULATED = 24
"""Scans; what is compiled is made of the first sixteen."""


def longer(kind: str) -> dict[str, Any]:
    """The small scenario of a kind with more scans."""
    scenario = dict(SCENARIOS[kind])
    name = {"frames": "frames", "bearings": "scans", "returns": "pings"}[kind]
    simulation = scenario["simulation"] | {name: SIMULATED}
    if kind == "frames":
        # As slow as it has to be to stay.
        simulation["targets"] = [target | {"velocity": (0.0, 0.5)} for target in simulation["targets"]]
    return scenario | {"simulation": simulation}


def tracked(scenario: dict[str, Any]) -> dict[str, Any]:
    """A scenario without its simulation."""
    return {name: part for name, part in scenario.items() if name != "simulation"}


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of images of the small scenario."""
    from PIL import Image

    folder = tmp_path_factory.mktemp("images")
    values = np.asarray(ft.simulate(longer("frames")).read(0, SIMULATED))
    low, high = float(values.min()), float(values.max())
    for number, frame in enumerate(values):
        level = np.round((frame - low) / (high - low) * 65535).astype(np.uint16)
        Image.fromarray(level).save(folder / f"frame_{number:04d}.png")
    return folder


def same(moments: list[Any], path: Path, scenario: Any) -> None:
    """Scan by scan, and to the roundings of sums in another order."""
    whole = ft.track(path, scenario).data
    assert [moment.time for moment in moments] == whole.time.values.tolist()
    existence = np.concatenate([moment.data.existence.values for moment in moments])
    np.testing.assert_allclose(existence, whole.existence, atol=1e-3)
    label = np.concatenate([moment.data.label.values for moment in moments])
    np.testing.assert_array_equal(label, whole.label)
    assert label.max() == 1, "the target is found"


def test_a_folder_that_fills_gives_the_numbers_of_track(images: Path, tmp_path: Path) -> None:
    """Each image is written in two halves, so that halves lie there to be read."""
    filling, stop, what = tmp_path / "filling", threading.Event(), tracked(longer("frames"))
    filling.mkdir()

    def fill() -> None:
        for file in sorted(images.iterdir()):
            content = file.read_bytes()
            (filling / file.name).write_bytes(content[: len(content) // 2])
            time.sleep(0.02)
            shutil.copy(file, filling / file.name)
        time.sleep(0.5)
        stop.set()

    threading.Thread(target=fill, daemon=True).start()
    same(list(GrowingWatch(filling, ft.Scenario(**what), stop=stop).moments()), images, what)


@pytest.mark.slow
def test_lines_that_come_give_the_numbers_of_track(tmp_path: Path) -> None:
    scenario = longer("bearings")
    whole, grows, stop = tmp_path / "whole.csv", tmp_path / "grows.csv", threading.Event()
    kind_named("bearings").write(whole, ft.simulate(scenario))
    what = tracked(scenario)

    def grow() -> None:
        content = whole.read_text()
        with grows.open("w") as file:
            for start in range(0, len(content), 97):
                file.write(content[start : start + 97])
                file.flush()
                time.sleep(0.02)
        stop.set()

    grows.touch()
    threading.Thread(target=grow, daemon=True).start()
    same(list(GrowingWatch(grows, ft.Scenario(**what), stop=stop).moments()), whole, what)


def test_what_cannot_be_read_at_the_end_is_told(tmp_path: Path) -> None:
    (tmp_path / "lines.csv").write_text("time_s,bearing_deg\n1.0,north\n")
    stop = threading.Event()
    stop.set()
    with pytest.raises(InputError, match=r"lines\.csv"):
        GrowingWatch(tmp_path / "lines.csv", ft.Scenario(**SCENARIOS["bearings"]), stop=stop)


@pytest.mark.parametrize(
    ("source", "options", "said"),
    [
        (["{}"], ["--speed", "2"], "--speed is of samples; the source holds frames"),
        (["{}"], ["--channels", "2", "--rate", "4"], "--channels is of samples; the source holds frames"),
        (["udp://127.0.0.1:9"], [], "is a source of samples and the scenario of frames"),
        (["tcp://127.0.0.1:9"], [], "tcp://127.0.0.1:9 cannot be connected to"),
    ],
)
def test_what_is_of_samples_is_refused(source: list[str], options: list[str], said: str, tmp_path: Path) -> None:
    done = call("live", *(word.format(tmp_path) for word in source), "--kind", "frames", *options)
    assert done.status == 2
    assert said in done.err


def until_scan(number: int, stop: threading.Event) -> Any:
    def see(watch: object, moment: object, event: dict[str, Any]) -> None:
        if event["scan"] == number:
            stop.set()

    return see


def parts_of(folder: Path) -> list[ft.Result]:
    return [ft.read_result(part) for part in sorted(folder.iterdir()) if part.is_dir() and part.name != "state"]


def test_a_folder_that_is_gone_on_with_gives_the_same_bits(images: Path, tmp_path: Path) -> None:
    """Stopped while the twentieth image was written, which is taken in again, whole; with alarms and reports."""
    filling, out, stop, told = tmp_path / "filling", tmp_path / "watch", threading.Event(), []
    filling.mkdir()
    files = sorted(images.iterdir())
    for file in files[:20]:
        shutil.copy(file, filling)
    rules = [{"name": "left", "region": {"x": [-0.5, 9.5]}}, {"name": "far", "region": {"x": [12, 19], "y": [12, 15]}}]
    what = ft.Scenario(**tracked(longer("frames")), alarm=rules)
    taken = run([str(filling)], what, out=out, tell=told.append, see=until_scan(18, stop), stop=stop)
    assert taken == 20
    for file in files[20:]:
        shutil.copy(file, filling)
    stop = threading.Event()
    last = until_scan(SIMULATED - 2, stop)
    assert run([str(filling)], what, out=out, tell=told.append, see=last, stop=stop) == SIMULATED - 19
    starts = [event for event in told if event["event"] == "start"]
    assert [start.get("goes_on") for start in starts] == [None, {"scan": 19}]
    alarms = [event for event in told if event["event"] == "alarm"]
    assert [(alarm["name"], alarm["label"]) for alarm in alarms] == [("left", 1)]
    whole = np.concatenate([moment.data.existence.values for moment in ft.follow(images, tracked(longer("frames")))])
    first, second = parts_of(out)
    assert first.data.sizes["time"] == 20
    np.testing.assert_array_equal(first.data.existence, whole[:20])
    np.testing.assert_array_equal(second.data.existence, whole[19:])
    assert (second.data.label.max("slot") == 1).all()
    for result in (first, second):
        result.report(tmp_path / "report.html")
    other = ft.Scenario(**tracked(longer("frames")), tracker={"declare": 0.9})
    with pytest.raises(InputError, match="the earlier run had another scenario"):
        run([str(filling)], other, out=out)
    (filling / files[-1].name).unlink()
    for file in files[15:-1]:
        (filling / file.name).unlink()
    with pytest.raises(InputError, match="holds 15 scans, of which an earlier run took in 23"):
        run([str(filling)], what, out=out, stop=stop)


def test_a_watch_that_was_killed_goes_on_with_the_same_numbers(
    images: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its folder as it was at that moment, with the state of the scan before."""
    monkeypatch.setattr("faintrack.live.keeping.SAVED", -1.0)
    out, killed, stop = tmp_path / "watch", tmp_path / "killed", threading.Event()

    def see(watch: object, moment: object, event: dict[str, Any]) -> None:
        if event["scan"] == 19:
            shutil.copytree(out, killed)
            stop.set()

    what = ft.Scenario(**tracked(longer("frames")))
    run([str(images)], what, out=out, see=see, stop=stop)
    assert list(killed.glob(".*partial"))
    run([str(images)], what, out=killed, stop=stop)
    lines = [json.loads(line) for file in sorted(killed.glob("*.jsonl")) for line in file.read_text().splitlines()]
    found = {event["scan"]: event for event in lines if event["event"] == "scan"}
    whole = list(ft.follow(images, tracked(longer("frames"))))
    # Digits are those of single precision.
    existence = [moment.existence for moment in whole]
    assert [found[number]["existence"] for number in range(SIMULATED)] == pytest.approx(existence, rel=1e-8)
    labels = [[track.label for track in moment.tracks] for moment in whole]
    assert [[row["label"] for row in found[number]["tracks"]] for number in range(SIMULATED)] == labels


def test_what_the_page_is_sent_tells_a_map(images: Path) -> None:
    """And figures for monitors, of a kind without a bearing-time record."""
    stop = threading.Event()
    stop.set()
    watch = GrowingWatch(images, ft.Scenario(**tracked(longer("frames"))), stop=stop)
    *_, moment = watch.moments()
    greeted, event = json.loads(greeting(watch, moment)), event_of(moment)
    assert [(place["name"], place["unit"]) for place in greeted["places"]] == [("x", "pixel"), ("y", "pixel")]
    assert [column["name"] for column in greeted["columns"]] == ["x", "y", "vx", "vy"]
    message = scan_message(watch, moment, event)
    (length,) = LENGTH.unpack_from(message)
    assert len(message) == LENGTH.size + length
    (track,) = json.loads(message[LENGTH.size :])["tracks"]
    assert {column["name"] for column in greeted["columns"]} <= set(track)
    assert f"faintrack_scans_total {SIMULATED}\n" in exposition(watch.status, watch.counts, event)


@pytest.mark.slow
def test_a_watch_that_ended_early_is_begun_anew(images: Path, tmp_path: Path) -> None:
    """A few images tell too little to choose by."""
    few, out, stop, told = tmp_path / "few", tmp_path / "watch", threading.Event(), []
    few.mkdir()
    files = sorted(images.iterdir())
    stop.set()
    what = ft.Scenario(**tracked(longer("frames")))
    for count in (5, SIMULATED):
        for file in files[:count]:
            shutil.copy(file, few)
        assert run([str(few)], what, out=out, tell=told.append, stop=stop) == count
    assert not any("goes_on" in event for event in told)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["bearings", "returns", "sweeps"])
def test_a_file_that_is_gone_on_with_gives_the_same_bits(kind: str, tmp_path: Path) -> None:
    """Stopped when eighteen scans were there. What is chosen by the data is said, as they are fewer at first."""
    file = tmp_path / FILES.get(kind, "small.npz")
    scenario = sweeps_scenario() if kind == "sweeps" else longer(kind)
    data, room, out, stop = ft.simulate(scenario), kind_named(kind), tmp_path / "watch", threading.Event()
    room.write(file, data)
    what = room.plan(data, ft.Scenario(**tracked(scenario))).scenario
    whole = list(ft.follow(file, what))
    assert room.stretch is not None
    room.write(file, room.stretch(data, 0.0, (whole[17].time + whole[18].time) / 2))
    assert run([str(file)], what, out=out, see=until_scan(16, stop), stop=stop) == 18
    room.write(file, data)
    stop = threading.Event()
    assert run([str(file)], what, out=out, see=until_scan(len(whole) - 2, stop), stop=stop) == len(whole) - 17
    first, second = parts_of(out)
    existence = np.concatenate([moment.data.existence.values for moment in whole])
    np.testing.assert_array_equal(first.data.existence, existence[:18])
    np.testing.assert_array_equal(second.data.existence, existence[17:])
    label = np.concatenate([moment.data.label.values for moment in whole])
    np.testing.assert_array_equal(second.data.label, label[17:])
    assert label.max() >= 1, "a target is found"
    second.report(tmp_path / "report.html")


@pytest.mark.parametrize(
    ("rule", "said"),
    [
        ({"sector": [0, 90]}, "sector is of bearings, and tracks of frames have x, y"),
        ({"region": {"x_m": [0, 1]}}, "region has x_m; expected some of x, y"),
    ],
)
def test_an_alarm_of_what_tracks_do_not_have_is_refused(rule: dict[str, Any], said: str, images: Path) -> None:
    stop = threading.Event()
    stop.set()
    with pytest.raises(InputError, match=said):
        run([str(images)], ft.Scenario(**tracked(longer("frames")), alarm=[rule]), stop=stop)


def given_on_standard_input(content: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", types.SimpleNamespace(buffer=io.BytesIO(content)))


@pytest.mark.slow
def test_lines_on_standard_input_are_taken_in_until_they_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One of them comes twice, which is told."""
    kind_named("bearings").write(tmp_path / "lines.csv", ft.simulate(longer("bearings")))
    what = ft.Scenario(**tracked(SCENARIOS["bearings"]))
    head, first, *rest = (tmp_path / "lines.csv").read_bytes().splitlines(keepends=True)
    given_on_standard_input(b"".join([head, first, first, *rest]), monkeypatch)
    events: list[Any] = []
    assert run(["-"], what, tell=events.append) == SIMULATED
    told = [event for event in events if event["event"] == "remark"]
    # A look may come before the first line.
    others = [event["event"] for event in events if event["event"] not in ("remark", "awaited")]
    assert others == ["start", *["scan"] * SIMULATED, "end"]
    assert len({event["text"] for event in told}) == len(told)
    assert ["stand in the file twice" in event["text"] for event in told] == [True]
    assert next(event["source"] for event in events if event["event"] == "start") == "standard input (lines of CSV)"


@pytest.mark.slow
def test_lines_over_tcp_are_gone_on_with(tmp_path: Path) -> None:
    """A sender that breaks off within a line, and comes again with its header and the rest."""
    kind_named("bearings").write(tmp_path / "whole.csv", ft.simulate(longer("bearings")))
    what = ft.Scenario(**tracked(longer("bearings")))
    head, *lines = (tmp_path / "whole.csv").read_bytes().splitlines(keepends=True)
    begun = next(number for number, line in enumerate(lines) if line.startswith(b"19,"))
    sent = [b"".join([head, *lines[:begun], lines[begun][:7]]), b"".join([head, *lines[begun:]])]
    seen: list[Any] = []
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def send() -> None:
            for content in sent:
                with listener.accept()[0] as connection:
                    connection.sendall(content)

        threading.Thread(target=send, daemon=True).start()
        for _ in sent:
            run([f"tcp://127.0.0.1:{listener.getsockname()[1]}"], what, out=tmp_path / "watch", tell=seen.append)
    found = {event["scan"]: event["existence"] for event in seen if event["event"] == "scan"}
    whole = [moment.existence for moment in ft.follow(tmp_path / "whole.csv", what)]
    assert [found[number] for number in range(SIMULATED)] == whole


def test_standard_input_without_lines_is_named_as_what_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    given_on_standard_input(b"\x89PNG\r\n", monkeypatch)
    with pytest.raises(InputError, match=r"^standard input \(lines of CSV\)"):
        run(["-"], ft.Scenario(**SCENARIOS["frames"]))
