"""An alarm is told once for each track, signed where it is sent, and not again by a run that goes on."""

import hashlib
import hmac
import json
import math
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import numpy as np
import pytest
import soundfile

import faintrack as ft
from faintrack.live.alarms import AlarmBell, restored
from faintrack.live.run import run
from faintrack.live.webhook import Webhooks
from faintrack.scenario.alarm import AlarmSection
from tests.live.streams import RATE, samples, scenario

SECRET = b"a long and secret word"


def scan(time: float, **bearings: float) -> dict:
    tracks = [{"label": int(name[1:]), "existence": 0.99, "bearing_deg": value} for name, value in bearings.items()]
    return {"event": "scan", "time": time, "tracks": tracks}


def labels(bell: AlarmBell, event: dict) -> list[tuple[str, int]]:
    return [(alarm["name"], alarm["label"]) for _, alarm in bell.take(event)]


def test_once_for_each_track_and_rule() -> None:
    bell = AlarmBell([AlarmSection(name="any"), AlarmSection(name="east", sector=(80, 100), longer_than=1.0)])
    assert labels(bell, scan(0.0, _1=90.0)) == [("any", 1)]
    assert labels(bell, scan(1.0, _1=90.0, _2=10.0)) == [("any", 2), ("east", 1)]
    assert labels(bell, scan(2.0, _1=90.0, _2=95.0)) == []
    # The time within begins anew after a break.
    assert labels(bell, scan(2.5, _2=79.0)) == []
    assert labels(bell, scan(3.1, _2=81.0)) == []
    assert labels(bell, scan(4.1, _2=82.0)) == [("east", 2)]


def test_what_is_not_known_is_in_no_sector() -> None:
    assert labels(AlarmBell([AlarmSection()]), scan(0.0, _1=float("nan"))) == []


def test_a_region_is_of_all_its_components() -> None:
    rule = AlarmSection(name="harbour", region={"x_m": (0.0, 10.0), "y_m": (-5.0, 5.0)})
    places = [(1, 5.0, 6.0), (2, 11.0, 0.0), (3, 10.0, -5.0), (4, math.nan, 0.0), (5, 3.0, 3.0)]
    tracks = [{"label": label, "existence": 0.99, "x_m": x, "y_m": y} for label, x, y in places]
    alarms = AlarmBell([rule]).take({"time": 0.0, "tracks": tracks})
    assert [alarm["label"] for _, alarm in alarms] == [3, 5]


def test_a_bell_that_was_saved_tells_nothing_twice() -> None:
    rules = [AlarmSection(longer_than=1.0)]
    bell = AlarmBell(rules)
    labels(bell, scan(0.0, _1=0.0))
    labels(bell, scan(1.0, _1=0.0, _2=0.0))
    again = restored(rules, json.loads(json.dumps(bell.saved())))
    assert labels(again, scan(2.0, _1=0.0, _2=0.0)) == [("alarm", 2)]


@pytest.fixture
def receiver() -> Iterator[tuple[str, list]]:
    """Address of a receiver, and what it took; the first call is answered that it is busy."""
    taken: list = []

    class Receiver(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            taken.append((dict(self.headers), self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(503 if len(taken) == 1 else 302 if self.path == "/away" else 200)
            self.send_header("Location", "/elsewhere")
            self.end_headers()

        def log_message(self, *arguments: object) -> None:
            pass

    server = HTTPServer(("127.0.0.1", 0), Receiver)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}", taken
    server.shutdown()


def test_a_webhook_is_signed_and_sent_again(receiver: tuple[str, list]) -> None:
    address, taken = receiver
    told: list = []
    hooks = Webhooks(told.append, pauses=(0.05,))
    hooks.send(f"{address}/alarm", SECRET, {"event": "alarm", "name": "south", "label": 3})
    hooks.finish(10.0)
    headers, body = taken[1]
    assert len(taken) == 2
    assert json.loads(body) == {"event": "alarm", "name": "south", "label": 3}
    signed = headers["X-Faintrack-Time"].encode() + b"." + body
    assert headers["X-Faintrack-Signature"] == "sha256=" + hmac.new(SECRET, signed, hashlib.sha256).hexdigest()
    assert told == []
    # An answer that points elsewhere is not followed.
    hooks.send(f"{address}/away", SECRET, {"event": "alarm", "name": "south", "label": 4})
    hooks.finish(10.0)
    assert len(taken) == 4
    assert [event["event"] for event in told] == ["webhook_failed"]


def test_a_watch_gives_an_alarm(tmp_path: Path, receiver: tuple[str, list]) -> None:
    """Also started again: the track is the same, and the alarm was given."""
    address, taken = receiver
    (tmp_path / "secret").write_bytes(SECRET)
    hook = {"webhook": f"{address}/alarm", "secret_file": str(tmp_path / "secret")}
    what = scenario(alarm=[{"name": "ahead", "sector": [40, 75], "longer_than": 1.5, **hook}, {"sector": [100, 180]}])
    soundfile.write(tmp_path / "night.wav", samples(), int(RATE), subtype="FLOAT")
    words, stop, told = ["replay", str(tmp_path / "night.wav")], threading.Event(), []

    def see(watch: object, moment: object, event: dict) -> None:
        if event["scan"] == 19:
            stop.set()

    run(words, what, out=tmp_path / "watch", speed=np.inf, tell=told.append, see=see, stop=stop)
    first_time = next(event["time"] for event in told if event["event"] == "scan" and event["tracks"])
    (alarm,) = (event for event in told if event["event"] == "alarm")
    assert (alarm["name"], alarm["label"], alarm["time"]) == ("ahead", 1, first_time + 1.5)
    assert json.loads(taken[-1][1])["label"] == 1
    run(words, what, out=tmp_path / "watch", speed=np.inf, tell=told.append)
    assert sum(event["event"] == "alarm" for event in told) == 1


@pytest.mark.parametrize(
    ("alarm", "said"),
    [
        ({"when": "loud"}, r"alarm\[0\].when is 'loud'"),
        ({"sector": [1]}, r"alarm\[0\].sector"),
        ({"longer_than": -1.0}, r"alarm\[0\].longer_than is -1.0"),
        ({"webhook": "ftp://x", "secret_file": "s"}, "expected an address that begins with http"),
        ({"webhook": "http://x"}, "webhook and secret_file: expected both or none"),
        ({"region": {"x_m": [5.0, 1.0]}}, "region.x_m: expected the smaller number first"),
        ({"name": ""}, r"alarm\[0\].name"),
        ({"sectors": [0, 1]}, "did you mean"),
    ],
)
def test_a_wrong_rule_is_one_sentence(alarm: dict, said: str) -> None:
    with pytest.raises(ft.InputError, match=said):
        scenario(alarm=[alarm])


def test_a_secret_must_be_there(tmp_path: Path) -> None:
    what = scenario(alarm=[{"webhook": "http://x", "secret_file": str(tmp_path / "none")}])
    with pytest.raises(ft.InputError, match="none cannot be read"):
        run(["-"], what)
