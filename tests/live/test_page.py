"""The page is served to who may see it, shows a track, and asks nothing of any other machine."""

import asyncio
import json
import re
import sys
import threading
import time
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import faintrack as ft
from faintrack.live.page.feed import LENGTH, greeting, scan_message
from faintrack.live.page.guard import guard_of
from faintrack.live.page.server import QUEUE, STATIC, WATCHERS, Page
from faintrack.live.watch import Watch
from tests.cli.calling import call
from tests.live.streams import pieces, samples, scenario, stream

tornado = pytest.importorskip("tornado")

from tornado.httpclient import AsyncHTTPClient, HTTPClientError, HTTPRequest  # noqa: E402
from tornado.websocket import websocket_connect  # noqa: E402

TOKEN = "a long and secret word"
MOST = 10.0
"""Seconds that a message may take in a test."""


@pytest.fixture(scope="module")
def messages() -> tuple[str, list[bytes]]:
    from faintrack.live.lines import event_of

    watch = Watch(stream(pieces(samples())), scenario())
    moments = list(watch.moments())
    return greeting(watch, moments[0]), [scan_message(watch, moment, event_of(moment)) for moment in moments]


@pytest.fixture
def page() -> Iterator[Page]:
    with Page(0, guard_of("127.0.0.1")) as page:
        yield page


@pytest.fixture
def closed(tmp_path: Path) -> Iterator[Page]:
    """A page that asks for a token."""
    (tmp_path / "token").write_text(TOKEN + "\n", encoding="utf-8")
    with Page(0, guard_of("127.0.0.1", tmp_path / "token")) as page:
        yield page


def ask(page: Page, path: str = "/", **options: object) -> tuple[int, str, dict]:
    async def asked() -> tuple[int, str, dict]:
        request = HTTPRequest(page.url.rstrip("/") + path, follow_redirects=False, **options)
        done = await AsyncHTTPClient(force_instance=True).fetch(request, raise_error=False)
        return done.code, done.body.decode(), dict(done.headers)

    return asyncio.run(asked())


def socket_request(page: Page, **headers: str) -> HTTPRequest:
    address = page.url.removeprefix("http://").rstrip("/")
    return HTTPRequest(f"ws://{address}/scans", headers={"Origin": f"http://{address}", **headers})


def listen(page: Page, count: int, **headers: str) -> list[str | bytes]:
    async def listened() -> list[str | bytes]:
        connection = await websocket_connect(socket_request(page, **headers))
        said = [await asyncio.wait_for(connection.read_message(), MOST) for _ in range(count)]
        connection.close()
        return said

    return asyncio.run(listened())


def refused(page: Page, **headers: str) -> int:
    with pytest.raises(HTTPClientError) as raised:
        listen(page, 1, **headers)
    return raised.value.code


def scan_of(message: bytes) -> tuple[dict, np.ndarray]:
    (length,) = LENGTH.unpack_from(message)
    return json.loads(message[4 : 4 + length]), np.frombuffer(message, np.uint8, offset=4 + length)


def test_the_page_and_nothing_else_is_served(page: Page) -> None:
    for path, (name, kind) in STATIC.items():
        status, body, headers = ask(page, path)
        assert (status, headers["Content-Type"]) == (200, kind)
        assert body.encode() == (files("faintrack.live.page") / "static" / name).read_bytes()
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert set(re.findall(r"[a-z-]+-src ([^;]+)", policy)) == {"'none'", "'self'"}
        assert (headers["X-Content-Type-Options"], headers["X-Frame-Options"]) == ("nosniff", "DENY")
    for path in ("/../guard.py", "/static/page.js", "/page.js/", "/%2e%2e/guard.py", "/enter.html", "/favicon.ico"):
        assert ask(page, path)[0] == 404
    assert ask(page, "/", method="POST", body="x" * 5000)[0] in (400, 405, 413, 599)


def test_the_page_asks_nothing_of_another_machine() -> None:
    """No address stands in it, and what comes from data is never made into markup."""
    for file in (files("faintrack.live.page") / "static").iterdir():
        text = file.read_text(encoding="utf-8")
        assert not re.findall(r"https?://|wss?://[a-z0-9]|//[a-z0-9.-]+\.[a-z]{2,}|@import|url\(", text), file.name
        assert not re.findall(r"innerHTML|outerHTML|insertAdjacent|document\.write|eval\(|\bon\w+\s*=\s*\"", text)
        assert not re.findall(r"<style|style=|<script>", text)
    size = sum(len(file.read_bytes()) for file in (files("faintrack.live.page") / "static").iterdir())
    assert size < 100_000


def test_a_track_appears(page: Page, messages: tuple[str, list[bytes]]) -> None:
    page.greet(messages[0])
    for message in messages[1]:
        page.send(message)
    first, *scans = listen(page, 33)
    greeted = json.loads(first)
    assert (greeted["event"], greeted["declare"], greeted["scan_interval"]) == ("greeting", 0.97, 0.5)
    assert greeted["places"] == [{"name": "bearing_deg", "unit": "degree", "ends": [0.0, 180.0]}]
    moments = list(ft.follow(ft.from_samples(samples(), 1000.0), scenario()))
    for message, moment in zip(scans, moments, strict=True):
        event, row = scan_of(message)
        assert [track["label"] for track in event["tracks"]] == [track.label for track in moment.tracks]
        # A step of a byte, rounded.
        told = event["low_db"] + row / 255 * (event["high_db"] - event["low_db"])
        step = (event["high_db"] - event["low_db"]) / 255
        np.testing.assert_allclose(told, moment.data.record.values[0], atol=0.51 * step + 1e-5)
    assert scan_of(scans[-1])[0]["tracks"][0]["bearing_deg"] == pytest.approx(np.degrees(1.0), abs=3)
    assert scan_of(scans[-1])[0]["status"]["gaps"] == 0


def test_what_comes_later_is_sent_as_it_comes(page: Page) -> None:
    def later() -> None:
        while not page.watchers:
            time.sleep(0.01)
        page.send("first")
        page.send(b"second")

    threading.Thread(target=later).start()
    assert listen(page, 2) == ["first", b"second"]


@pytest.mark.parametrize("host", ["stranger.example", "127.0.0.1.stranger.example:80", "10.0.0.7", "", "[::2]"])
def test_another_host_is_refused(page: Page, host: str) -> None:
    assert ask(page, headers={"Host": host})[0] in (400, 403)
    assert refused(page, Host=host, Origin=f"http://{host}") in (400, 403)


@pytest.mark.parametrize("origin", ["http://stranger.example", "null", "http://127.0.0.1:1", "https://127.0.0.1"])
def test_another_origin_is_refused(page: Page, origin: str) -> None:
    assert refused(page, Origin=origin) == 403


def test_a_token_is_asked_for(closed: Page) -> None:
    status, body, headers = ask(closed)
    assert (status, "password" in body) == (401, True)
    assert "Set-Cookie" not in headers
    origin = closed.url.rstrip("/")
    wrong = {"method": "POST", "body": "token=wrong", "headers": {"Origin": origin}}
    assert ask(closed, "/enter", **wrong)[0] == 403
    body = f"token={TOKEN.replace(' ', '+')}"
    assert ask(closed, "/enter", method="POST", body=body, headers={"Origin": "http://stranger.example"})[0] == 403
    status, _, headers = ask(closed, "/enter", method="POST", body=body, headers={"Origin": origin})
    assert status == 302
    assert "HttpOnly" in headers["Set-Cookie"]
    assert "SameSite=Strict" in headers["Set-Cookie"]
    assert TOKEN not in headers["Set-Cookie"]
    cookie = headers["Set-Cookie"].partition(";")[0]
    assert ask(closed, headers={"Cookie": cookie})[0] == 200
    assert ask(closed, headers={"Cookie": "faintrack=wrong"})[0] == 401
    assert refused(closed) == 401
    assert refused(closed, Authorization="Bearer wrong") == 401
    closed.send("seen")
    assert listen(closed, 1, Cookie=cookie) == listen(closed, 1, Authorization=f"Bearer {TOKEN}") == ["seen"]


def test_a_watcher_that_speaks_is_shown_out(page: Page) -> None:
    async def speak(message: str) -> int:
        connection = await websocket_connect(socket_request(page))
        await connection.write_message(message)
        assert await asyncio.wait_for(connection.read_message(), MOST) is None
        return connection.close_code

    assert asyncio.run(speak("hello")) == 1008
    assert asyncio.run(speak("x" * 10_000)) == 1009
    assert page.watchers == 0


def test_a_watcher_that_does_not_read_is_dropped_and_the_others_are_not(page: Page) -> None:
    count, size = 40 * QUEUE, 20_000

    async def stalled() -> None:
        from tornado.tcpclient import TCPClient

        address = page.url.removeprefix("http://").rstrip("/")
        raw = await TCPClient().connect("127.0.0.1", page.port)
        head = f"GET /scans HTTP/1.1\r\nHost: {address}\r\nOrigin: http://{address}\r\nUpgrade: websocket\r\n"
        head += (
            "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n\r\n"
        )
        await raw.write(head.encode())
        reader = await websocket_connect(socket_request(page))
        while page.watchers < 2:
            await asyncio.sleep(0.01)
        got = 0
        for number in range(count):
            page.send(number.to_bytes(4, "little") + bytes(size))
            message = await asyncio.wait_for(reader.read_message(), MOST)
            got += int.from_bytes(message[:4], "little") == number
        assert got == count
        # Some of what was sent lies in the system's own buffers, a few megabytes.
        assert page.watchers == 1
        reader.close()
        raw.close()

    asyncio.run(stalled())


def test_the_number_of_watchers_is_bounded(page: Page) -> None:
    async def crowd() -> int:
        connections = [await websocket_connect(socket_request(page)) for _ in range(WATCHERS)]
        while page.watchers < WATCHERS:
            await asyncio.sleep(0.01)
        with pytest.raises(HTTPClientError) as raised:
            await websocket_connect(socket_request(page))
        for connection in connections:
            connection.close()
        return raised.value.code

    assert asyncio.run(crowd()) == 503


def test_without_tornado_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tornado", None)
    with pytest.raises(ft.InputError, match=r"the page needs Tornado; expected pip install \"faintrack\[live\]\""):
        Page(0, guard_of("127.0.0.1"))


@given(st.text(max_size=60))
def test_no_text_is_the_token(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    file = tmp_path_factory.getbasetemp() / "token"
    file.write_text(TOKEN, encoding="utf-8")
    guard = guard_of("0.0.0.0", file)
    assert guard.knows(text) == (text == TOKEN)
    assert not guard.entered(text)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--host", "0.0.0.0"), "--host is 0.0.0.0, which others can reach; expected --token-file FILE"),
        (("--host", "here"), "--host is here; expected an address of this machine"),
        (("--host", "0.0.0.0", "--token-file", "short"), "short holds no token; expected one line of 16 characters"),
        (("--token-file", "nowhere"), "nowhere cannot be read"),
        (("--port", "70000"), "--port is 70000; expected 1 to 65535"),
        (("--host", "192.0.2.1", "--token-file", "token"), "port 8080 at 192.0.2.1 cannot be listened to"),
    ],
)
def test_bad_input_is_one_sentence(
    arguments: tuple[str, ...], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("short").write_text("short", encoding="utf-8")
    Path("token").write_text(TOKEN, encoding="utf-8")
    port = () if "--port" in arguments else ("--port", "8080")
    scenario().save("scenario.toml")
    Path("raw").write_bytes(bytes(16))
    raw = ("raw", "--channels", "4", "--rate", "1000")
    done = call("live", *raw, *port, *arguments, "--scenario", "scenario.toml")
    assert done.status == 2, done.err
    assert said in done.err
    assert done.err.count("\n") == 1


def test_health_and_figures_are_answered(page: Page, closed: Page) -> None:
    assert ask(page, "/health")[0] == 503
    for each in (page, closed):
        each.measure("faintrack_scans_total 1\n")
        assert ask(each, "/health")[:2] == (200, "ok\n")
    assert ask(page, "/metrics")[:2] == (200, "faintrack_scans_total 1\n")
    assert ask(closed, "/metrics")[0] == 401
    assert ask(closed, "/metrics", headers={"Authorization": f"Bearer {TOKEN}"})[0] == 200
    assert ask(page, "/health", headers={"Host": "elsewhere.example"})[0] == 403
