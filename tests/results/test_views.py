"""What the report zooms: the data of a result, thinned, in a page that asks nobody for anything."""

import base64
import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.results.coast import coast_lines
from faintrack.results.result import Result
from faintrack.results.schema import NORTH, bearing, estimated
from faintrack.results.views import POINTS, script, views
from faintrack.targets.states import BearingState
from tests.kinds.small import result
from tests.results.test_exports import TWO, made

NODE = shutil.which("node")
STUB = """
const drawn = {fillText: [], lineTo: 0};
function drew(name, args) {
  if (name === "fillText") drawn.fillText.push(args[0]);
  if (name === "lineTo") { drawn.lineTo++; if (!args.every(Number.isFinite)) throw new Error("no number"); }
}
const pixels = (wide, high) => ({data: new Uint8ClampedArray(4 * wide * high)});
const get = (_, name) => name === "createImageData" ? pixels : (...args) => drew(name, args);
const g = new Proxy({}, {get, set: () => true});
const listeners = [];
const element = () => ({style: {}, setAttribute() {}, appendChild() {}, getContext: () => g, clientWidth: 800,
  clientHeight: 300, addEventListener: (name, call) => listeners.push([name, call]), setPointerCapture() {},
  getBoundingClientRect: () => ({left: 0, top: 0})});
const saying = element();
globalThis.document = {getElementById: (id) => id === "said" ? saying : element(), createElement: element};
globalThis.window = {devicePixelRatio: 2, addEventListener() {}};
"""
AFTER = """
for (const [name, call] of listeners) {
  const event = {preventDefault() {}, clientX: 300, clientY: 120, deltaY: -300, pointerId: 1};
  call(event);
}
for (let px = 64; px < 800; px += 2) for (let py = 0; py < 300; py += 4) for (const [name, call] of listeners)
  if (name === "pointermove" && !saying.textContent) call({clientX: px, clientY: py, pointerId: 9});
console.log(JSON.stringify({texts: drawn.fillText, lines: drawn.lineTo, said: saying.textContent || ""}));
"""


def hour() -> Result:
    """An hour of scans of a second with a record of 180 beams, and a track that turns through south."""
    count = 3600
    degrees = (170 + np.arange(count) / 120 + 180) % 360 - 180
    say = SimpleNamespace(
        existence=np.full(count, 0.9),
        label=np.ones(count, int),
        track_existence=np.full(count, 0.9),
        mean=BearingState(*(jnp.asarray(part) for part in (np.radians(degrees), 0 * degrees, 0 * degrees))),
        covariance=np.tile(np.eye(3) * 1e-4, (count, 1, 1)),
    )
    data = estimated(np.arange(count) + 0.5, say, bearing(NORTH))
    noise = np.random.default_rng(0).normal(size=(count, 180)).astype(np.float32)
    data["record"] = ("time", "beam"), noise, {"units": "dB"}
    data = data.assign_coords(beam=("beam", np.arange(-179.0, 181, 2), {"reference": NORTH}))
    data = data.assign_attrs(source="<script>", start_time="2020-05-01T23:30:00Z", scan_interval=1.0)
    return replace(result("recording"), data=data)


def test_an_hour_is_below_5_mb_and_asks_nobody(tmp_path: Path) -> None:
    text = hour().report(tmp_path / "report.html").read_text(encoding="utf-8")
    assert len(text.encode()) < 5e6
    assert not re.findall(r"""(?:src|href)\s*=\s*(?!["']?data:)|https?://|fetch\(|import\(""", text)
    assert "<script>" in text
    assert text.count("</script>") == 1


def test_the_record_is_in_bytes_and_the_track_is_thinned() -> None:
    shown = views(hour())
    (bearings, _) = shown["panels"]
    scans, beams = bearings["image"]["shape"]
    assert len(base64.b64decode(bearings["image"]["bytes"])) == scans * beams
    (line,) = bearings["tracks"]
    assert len(line["time"]) == POINTS
    (cut,) = line["cut"]
    assert (line["value"][cut - 1] > 179.9, line["value"][cut] < -179.9) == (True, True)
    assert shown["map"] is None


def test_a_map_has_ways_ellipses_and_the_coast() -> None:
    """The tracks of the tests are in the Alboran Sea: Gibraltar is 12 km away."""
    shown = views(made(TWO))["map"]
    assert [line["label"] for line in shown["lines"]] == [1, 2]
    west, east, south, north = shown["box"]
    assert west < -5 < -4.994 < east
    assert south < 36 < 36.003 < north
    assert len(shown["rings"]) == 4
    assert not shown["coast"]


def test_the_coast_is_where_it_is() -> None:
    """The southern point of Africa is Cape Agulhas, 34.83 S, 20.00 E; a box across 180 degrees holds Fiji."""
    lines = np.concatenate(coast_lines((19, 21), (-36, -34)))
    south = lines[lines[:, 1].argmin()]
    np.testing.assert_allclose(south, [20.0, -34.83], atol=0.03)
    across = np.concatenate(coast_lines((177, 181), (-18, -16)))
    assert (across[:, 0] > 180).any()
    assert (across[:, 0] < 180).any()
    assert across[:, 0].min() > 170


@pytest.mark.skipif(NODE is None, reason="needs node")
@pytest.mark.parametrize("which", ["hour", "map", "frames"])
def test_the_script_runs_and_says_what_is_pointed_at(which: str, tmp_path: Path) -> None:
    one = {"hour": hour, "map": lambda: made(TWO), "frames": lambda: result("frames")}[which]()
    code = re.search(r"<script>(.*)</script>", script(one), re.DOTALL)
    assert code is not None
    (tmp_path / "a.js").write_text(STUB + code[1] + AFTER, encoding="utf-8")
    done = subprocess.run([str(NODE), str(tmp_path / "a.js")], capture_output=True, text=True)
    assert not done.stderr
    said = json.loads(done.stdout)
    assert said["lines"] > 5
    assert said["said"].startswith("track ")
    assert ("UTC" in said["said"]) == (which != "frames")
    if which == "hour":
        assert {"23:40:00", "00:00:00"} & set(said["texts"])


def test_files_beside_the_report_are_linked(tmp_path: Path) -> None:
    folder = result("frames").save(tmp_path / "night")
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert '<a href="states.csv">' in text
    assert "tracks.geojson" not in text
    away = result("frames").report(tmp_path / "away.html").read_text(encoding="utf-8")
    assert "<a href" not in away
