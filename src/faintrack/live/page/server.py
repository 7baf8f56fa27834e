"""The server of the page: static files from the package, and a socket to which scans are sent.

It runs in a thread of its own and cannot hold up the loop. Each watcher has a short queue; one that does not read it in
time is dropped and may come again. Requests are small and bounded, and nothing that a watcher sends is acted on.
"""

import asyncio
import threading
from collections import deque
from importlib.resources import files
from typing import Any
from urllib.parse import parse_qs

from faintrack.errors import InputError
from faintrack.live.page.guard import Guard

WATCHERS = 64
"""At once at most."""

QUEUE = 64
"""Messages that a watcher may be behind."""

HISTORY = 600
"""Scans that one who comes later is shown."""

HISTORY_BYTES = 2**23
"""Of them at most."""

LARGEST = 2048
"""Bytes of a message or form that a watcher sends."""

COOKIE = "faintrack"

HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
    "Server": "faintrack",
}

STATIC = {
    "/": ("page.html", "text/html; charset=utf-8"),
    "/page.js": ("page.js", "text/javascript; charset=utf-8"),
    "/drawing.js": ("drawing.js", "text/javascript; charset=utf-8"),
    "/map.js": ("map.js", "text/javascript; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
}
"""Everything that is served: no path of a request is ever looked up on the disk."""


class Page:
    """The page while it is served; a context manager.

    Parameters
    ----------
    port : of TCP; any that is free where 0.
    guard : who may see it.

    Raises
    ------
    InputError : Tornado is not installed, or the port cannot be had.
    """

    def __init__(self, port: int, guard: Guard) -> None:
        try:
            import tornado  # noqa: F401
        except ImportError as error:
            raise InputError('the page needs Tornado; expected pip install "faintrack[live]".') from error
        if not 0 <= port < 2**16:
            raise InputError(f"--port is {port}; expected 1 to 65535.")
        self.guard, self.port = guard, port
        self._loop = asyncio.new_event_loop()
        self._watchers: set[Any] = set()
        self._greeting: str | None = None
        self._metrics = ""
        self._history: deque[bytes | str] = deque()
        self._bytes = 0
        self._thread: threading.Thread | None = None

    def __enter__(self) -> "Page":
        ready, failed = threading.Event(), list[OSError]()

        def serve() -> None:
            asyncio.set_event_loop(self._loop)
            try:
                self._loop.run_until_complete(self._listen())
            except OSError as error:
                failed.append(error)
                ready.set()
                return
            ready.set()
            self._loop.run_forever()

        self._thread = threading.Thread(target=serve, name="page", daemon=True)
        self._thread.start()
        ready.wait()
        if failed:
            raise InputError(
                f"port {self.port} at {self.guard.address} cannot be listened to ({failed[0].strerror}); expected "
                "another --port."
            )
        return self

    def __exit__(self, *error: object) -> None:
        async def end() -> None:
            self._server.stop()
            for watcher in list(self._watchers):
                watcher.close(1001, "the watch has ended")
            await asyncio.sleep(0.1)
            self._loop.stop()

        asyncio.run_coroutine_threadsafe(end(), self._loop)
        if self._thread is not None:
            self._thread.join(5.0)

    @property
    def url(self) -> str:
        """Where a browser finds it."""
        address = f"[{self.guard.address}]" if ":" in self.guard.address else self.guard.address
        return f"http://{address}:{self.port}/"

    @property
    def watchers(self) -> int:
        """How many there are."""
        return len(self._watchers)

    def greet(self, text: str) -> None:
        """Set what every watcher is sent first; called from any thread."""
        self._loop.call_soon_threadsafe(self._greet, text)

    def send(self, message: bytes | str) -> None:
        """Send to all watchers, and keep for those who come later; called from any thread, and never waits."""
        self._loop.call_soon_threadsafe(self._send, message)

    def measure(self, text: str) -> None:
        """Set what `/metrics` answers; called from any thread."""
        self._metrics = text

    def _greet(self, text: str) -> None:
        if text != self._greeting:
            self._greeting = text
            for watcher in list(self._watchers):
                watcher.offer(text)

    def _send(self, message: bytes | str) -> None:
        self._history.append(message)
        self._bytes += len(message)
        while len(self._history) > HISTORY or self._bytes > HISTORY_BYTES:
            self._bytes -= len(self._history.popleft())
        for watcher in list(self._watchers):
            watcher.offer(message)

    def _past(self) -> list[bytes | str]:
        return [*([] if self._greeting is None else [self._greeting]), *self._history]

    async def _listen(self) -> None:
        from tornado.httpserver import HTTPServer
        from tornado.netutil import bind_sockets
        from tornado.web import Application

        static, socket, entrance, figures = _handlers(self)
        application = Application(
            [
                *((path, static) for path in STATIC),
                ("/enter", entrance),
                ("/scans", socket),
                ("/metrics", figures),
                ("/health", figures),
            ],
            websocket_max_message_size=LARGEST,
            websocket_ping_interval=20,
            # Tokens and labels stay out of logs.
            log_function=lambda handler: None,
            default_handler_class=static,
        )
        sockets = bind_sockets(self.port, self.guard.address)
        self.port = sockets[0].getsockname()[1]
        self._server = HTTPServer(
            application,
            max_body_size=LARGEST,
            max_header_size=2**14,
            max_buffer_size=2**16,
            idle_connection_timeout=60,
            body_timeout=10,
        )
        self._server.add_sockets(sockets)


def _handlers(page: Page) -> tuple[Any, Any, Any, Any]:
    """Classes that answer requests to a page: for its files, socket, the form that asks for the token, and figures."""
    from tornado.iostream import StreamClosedError
    from tornado.web import RequestHandler
    from tornado.websocket import WebSocketClosedError, WebSocketHandler

    guard = page.guard
    contents = {path: (files(__package__) / "static" / name).read_bytes() for path, (name, _) in STATIC.items()}
    form = (files(__package__) / "static" / "enter.html").read_bytes()

    def refused(handler: Any, status: int, reason: str) -> None:
        handler.set_status(status)
        handler.set_header("Content-Type", "text/plain; charset=utf-8")
        handler.finish(reason)

    def may_see(handler: Any) -> bool:
        bearer = handler.request.headers.get("Authorization", "")
        if bearer.startswith("Bearer "):
            return guard.knows(bearer.removeprefix("Bearer "))
        return guard.entered(handler.get_cookie(COOKIE))

    class Answer(RequestHandler):
        """Of every request: this machine's own host, or nothing."""

        def set_default_headers(self) -> None:
            for name, value in HEADERS.items():
                self.set_header(name, value)

        def prepare(self) -> None:
            if not guard.host(self.request.host):
                refused(self, 403, "This host is not known.\n")

        def write_error(self, status_code: int, **options: Any) -> None:
            refused(self, status_code, "This is not here.\n")

    class Static(Answer):
        """Files of the page."""

        def get(self) -> None:
            path = self.request.path
            if path not in contents:
                refused(self, 404, "This is not here.\n")
            elif path == "/" and not may_see(self):
                self.set_status(401)
                self.set_header("Content-Type", "text/html; charset=utf-8")
                self.finish(form)
            else:
                self.set_header("Content-Type", STATIC[path][1])
                self.finish(contents[path])

    class Entrance(Answer):
        """Takes the token of a form."""

        async def post(self) -> None:
            if not guard.origin(self.request.headers.get("Origin"), self.request.host):
                return refused(self, 403, "This origin is not known.\n")
            token = parse_qs(self.request.body.decode(errors="replace")).get("token", [""])[0].strip()
            if not guard.knows(token):
                # Guessing takes a second a time.
                await asyncio.sleep(1.0)
                return refused(self, 403, "This is not the token.\n")
            self.set_cookie(COOKIE, guard.session, httponly=True, samesite="Strict", path="/")
            self.redirect("/")

    class Figures(Answer):
        """How the watch stands, for programs: whether scans are taken in, and figures."""

        def get(self) -> None:
            if self.request.path == "/health":
                known = bool(page._metrics)
                refused(self, 200 if known else 503, "ok\n" if known else "No scan has been taken in yet.\n")
            elif not may_see(self):
                refused(self, 401, "The token is missing or wrong.\n")
            else:
                self.set_header("Content-Type", "text/plain; version=0.0.4; charset=utf-8")
                self.finish(page._metrics)

    class Watcher(WebSocketHandler):
        """One who is sent scans."""

        def prepare(self) -> None:
            request = self.request
            if not guard.host(request.host):
                refused(self, 403, "This host is not known.\n")
            elif not guard.origin(request.headers.get("Origin"), request.host):
                refused(self, 403, "This origin is not known.\n")
            elif not may_see(self):
                refused(self, 401, "The token is missing or wrong.\n")
            elif page.watchers >= WATCHERS:
                refused(self, 503, "There are too many watchers.\n")

        def check_origin(self, origin: str) -> bool:
            return guard.origin(origin, self.request.host)

        def open(self, *arguments: str, **options: str) -> None:
            past = page._past()
            # The past is behind at once; what comes while it is sent may be as much again.
            self.queue: asyncio.Queue[bytes | str] = asyncio.Queue(len(past) + QUEUE)
            for message in past:
                self.queue.put_nowait(message)
            page._watchers.add(self)
            self.sending = asyncio.ensure_future(self.drain())

        async def drain(self) -> None:
            """Send what is in the queue, no faster than it is read."""
            try:
                while True:
                    message = await self.queue.get()
                    await self.write_message(message, binary=isinstance(message, bytes))
            except (WebSocketClosedError, StreamClosedError):
                page._watchers.discard(self)

        def offer(self, message: bytes | str) -> None:
            """Put a message into the queue, or drop the watcher where it is full."""
            try:
                self.queue.put_nowait(message)
            except asyncio.QueueFull:
                page._watchers.discard(self)
                self.sending.cancel()
                self.close(1013, "too slow")

        def on_message(self, message: bytes | str) -> None:
            self.close(1008, "nothing is expected")

        def on_close(self) -> None:
            page._watchers.discard(self)
            if hasattr(self, "sending"):
                self.sending.cancel()

    return Static, Watcher, Entrance, Figures
