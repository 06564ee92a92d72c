"""The page and its WebSocket, on this machine unless the user says otherwise. A page never slows the robot.

A page receives a picture while it paints the previous one, and the next only after it has shown that: a slow page gets
fewer, and a dead one gets two.
A client must have the token, in the address or in the cookie that the first visit sets. A page of another site is
refused by its Origin, even if its name was made to resolve to this machine.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import math
import os
import pathlib
from collections import Counter
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from ranger_sim.foundation import json_text
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.panel import export, messages
from ranger_sim.tools.panel.comparison import Comparison
from ranger_sim.tools.panel.connections import Connections
from ranger_sim.tools.panel.source import Source

PAGE = pathlib.Path(__file__).parent / "page"
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}
COOKIE = "ranger-sim-panel"
TWINS = "twins.html"

# Limits on a page, chosen by us.
PLACES = 16  # pages at a time: each costs a picture 30 times a second
AHEAD = 2  # pictures sent to a page and not yet shown: one is painted while the next is made
PICTURE_S = 1 / 33  # so that 30 in a second remain if some are late
STATE_S = 0.2
LONGEST_REQUEST = 1 << 16  # bytes: setting a parameter by name takes below 20,000
REQUESTS_PER_S = 50.0
BURST = 100.0
MOST_PLOTS = 24
MOST_CHANNELS = 48  # of all plots of a page, as RoboDAQ
MOST_POINTS = 4000
PATIENCE_S = 30.0  # without a message from the page
CLOSE_POLICY, CLOSE_FULL, LEFT = 1008, 1013, 1006  # RFC 6455 and its registry
BROKEN = {1002, 1003, 1007, 1009}  # the same registry: the client did not speak WebSocket, or sent too much at once


def place_of(origin: str) -> str:
    """Host and port of an Origin; empty if it has none."""
    try:
        return urlsplit(origin).netloc
    except ValueError:  # brackets that hold no address
        return ""


def cookie_of(asked: HTTPConnection) -> str:
    """Name of the cookie with the token: a browser keeps cookies by host, and every panel has a port of its host."""
    return f"{COOKIE}-{asked.scope['server'][1]}"


class PanelServer:
    """Serves one source. `app` is the ASGI application; `log` receives messages for the user."""

    def __init__(self, source: Source, token: str, hosts: tuple[str, ...], log: Callable[[str], None]) -> None:
        self.source = source
        self.token = token
        self.hosts = hosts  # names by which a browser may call this server
        self.log = log
        self.sessions: set[Session] = set()
        self.refused: Counter[str] = Counter()
        self.connections = Connections(lambda: {session.socket.client for session in self.sessions}, self.refuse)
        self.feeding: asyncio.Task[None] | None = None
        self.comparison = Comparison(source, self.renew)
        self.app = Starlette(
            routes=[
                Route("/", self.page),
                Route("/export/{kind}", self.export),
                Route(f"/{TWINS}", self.twins),
                Route("/{name}", self.file),
                WebSocketRoute("/socket", self.socket),
            ],
            lifespan=self.life,
        )

    @contextlib.asynccontextmanager
    async def life(self, app: Starlette) -> Any:
        """Run the source as long as the server."""
        self.feeding = asyncio.create_task(self.source.run())
        try:
            yield
        finally:
            self.feeding.cancel()
            await self.comparison.stop()

    # --- access ---------------------------------------------------------------------------------------------

    def fault_of(self, asked: HTTPConnection) -> str | None:
        """The reason to refuse this request; None if it is served."""
        host = asked.headers.get("host", "")
        if host.rpartition(":")[0].strip("[]") not in self.hosts:
            return "another host's name"
        origin = asked.headers.get("origin")
        if origin is not None and place_of(origin) != host:
            return "a page of another site"
        token = asked.query_params.get("token") or asked.cookies.get(cookie_of(asked)) or ""
        return None if hmac.compare_digest(token.encode(), self.token.encode()) else "a wrong token"

    async def page(self, request: Request) -> Response:
        """The page; the first visit sets the token as a cookie."""
        fault = self.fault_of(request)
        if fault is not None:
            return self.refusal(fault)
        answer = FileResponse(PAGE / "index.html", media_type=TYPES[".html"])
        answer.set_cookie(cookie_of(request), self.token, httponly=True, samesite="strict")
        answer.headers["Content-Security-Policy"] = (
            "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:"
        )
        answer.headers["Cache-Control"] = "no-store"
        return answer

    async def file(self, request: Request) -> Response:
        """A file of the page."""
        fault = self.fault_of(request)
        if fault is not None:
            return self.refusal(fault)
        name = request.path_params["name"]
        if name not in FILES:
            return PlainTextResponse(f"{name[:60]!r}: there is no such file", 404)
        return FileResponse(PAGE / name, media_type=TYPES[pathlib.Path(name).suffix])

    async def export(self, request: Request) -> Response:
        """Samples of channels in a window as a file, CSV or MF4."""
        fault = self.fault_of(request)
        if fault is not None:
            return self.refusal(fault)
        try:
            kind = request.path_params["kind"]
            if kind not in export.KINDS:
                raise UserError(f"{kind[:20]!r} is not a kind of file (available: {', '.join(export.KINDS)})")
            asked = request.query_params
            try:
                numbers = [int(each) for each in asked.get("channels", "").split(",") if each]
                begin, end = float(asked.get("begin", "nan")), float(asked.get("end", "nan"))
            except ValueError:
                raise UserError("export: channels, begin and end are numbers") from None
            channels = channels_of(numbers, self.source)
            seconds(begin, "begin")
            seconds(end, "end")
            data = await asyncio.to_thread(export.KINDS[kind], self.source, channels, begin, end)
        except UserError as mistake:
            return PlainTextResponse(f"{mistake}\n", 400)
        headers = {"Content-Disposition": f'attachment; filename="selection.{kind}"'}
        return Response(data, media_type="application/octet-stream", headers=headers)

    async def twins(self, request: Request) -> Response:
        """The report of the last comparison with twins: a page without links to anything."""
        fault = self.fault_of(request)
        if fault is not None:
            return self.refusal(fault)
        if not self.comparison.report:
            return PlainTextResponse(f"{TWINS}: no walk has been compared yet\n", 404)
        return Response(self.comparison.report, media_type=TYPES[".html"])

    def renew(self) -> None:
        """Send every page the state."""
        for session in self.sessions:
            session.next_state_s = 0.0
            session.changed.set()

    def refusal(self, fault: str) -> Response:
        """Count a refused request and return the response."""
        self.refuse(fault)
        return PlainTextResponse(f"{fault}: the address that `ranger-sim panel` printed has the right one\n", 403)

    def refuse(self, fault: str) -> None:
        """Count it; log the first of its kind."""
        self.refused[fault] += 1
        if self.refused[fault] == 1:
            self.log(f"panel: a request with {fault} was refused; others of this kind are counted")

    def want(self) -> None:
        """Report to the source which channels all pages show."""
        self.source.want(sorted({channel for session in self.sessions for channel in session.wanted}))

    async def socket(self, socket: WebSocket) -> None:
        """Serve one page until it disconnects or is closed with a reason."""
        fault = self.fault_of(socket)
        if fault is None and len(self.sessions) >= PLACES:
            fault = f"no place free ({PLACES} pages)"
        if fault is not None:
            self.refuse(fault)
            self.connections.ends(socket.client)
            with contextlib.suppress(WebSocketDisconnect):
                await socket.accept()
                await socket.close(CLOSE_FULL if "place" in fault else CLOSE_POLICY, fault)
            return
        await socket.accept()
        session = Session(self.source, socket, self.want, self.comparison)
        self.sessions.add(session)
        try:
            reason = await session.serve()
        finally:
            self.sessions.discard(session)
            self.connections.ends(socket.client)  # even if unread data are queued before the reason
        if reason:
            self.refuse(reason)
            with contextlib.suppress(Exception):
                await socket.close(CLOSE_POLICY, reason)


FILES = frozenset(path.name for path in PAGE.iterdir() if path.suffix in TYPES) if PAGE.is_dir() else frozenset()


class Session:
    """One page: what it requests, and what it has shown."""

    def __init__(self, source: Source, socket: WebSocket, wants: Callable[[], None], comparison: Comparison) -> None:
        self.source = source
        self.comparison = comparison
        self.wants = wants  # called when the channels of its plots change
        self.socket = socket
        self.plots: dict[int, Plot] = {}
        self.wanted: set[int] = set()  # channels of its plots, including those that another view hides
        self.at: float | None = None  # the page's cursor; None: the newest
        self.unshown = 0  # pictures sent and not yet shown
        self.shown = asyncio.Event()  # the page has shown one
        self.changed = asyncio.Event()  # the page requests something else
        self.allowance = BURST
        self.request_s = 0.0
        self.next_state_s = 0.0
        self.sending = asyncio.Lock()

    async def serve(self) -> str:
        """Serve until the page disconnects; returns why it was closed, or ""."""
        showing: asyncio.Task[None] | None = None
        try:
            await self.send(messages.text({"hello": self.source.hello(), "version": messages.VERSION}))
            showing = asyncio.create_task(self.show())
            while True:
                try:
                    async with asyncio.timeout(PATIENCE_S):
                        text = await self.socket.receive_text()
                except (RuntimeError, KeyError):  # it has disconnected, or it sent bytes
                    return ""
                if showing.done():
                    showing.result()
                reason = await self.on_text(text)
                if reason:
                    return reason
        except TimeoutError:
            return "silence"
        except WebSocketDisconnect as left:
            return "a broken message" if left.code in BROKEN else ""
        finally:
            if showing is not None:
                showing.cancel()
                await asyncio.gather(showing, return_exceptions=True)

    async def send(self, message: bytes) -> None:
        """Send one message at a time. TimeoutError: the page no longer reads. WebSocketDisconnect: it has left."""
        async with asyncio.timeout(PATIENCE_S), self.sending:
            try:
                await self.socket.send_bytes(message)
            except RuntimeError as gone:  # the server has closed it meanwhile because of an invalid frame
                raise WebSocketDisconnect(LEFT) from gone

    # --- requests of the page -------------------------------------------------------------------------------

    async def on_text(self, text: str) -> str:
        """Handle one message of the page; returns the reason to close it, or ""."""
        now_s = asyncio.get_running_loop().time()
        self.allowance = min(BURST, self.allowance + REQUESTS_PER_S * (now_s - self.request_s))
        self.request_s = now_s
        if self.allowance < 1.0:
            return "too many requests"
        self.allowance -= 1.0
        try:
            request = json_text.loads(text, "a message")
        except json_text.JsonError:
            return "a message that is not JSON"
        if not isinstance(request, dict):
            return "a message that is not a JSON object"
        number = request.pop("number", None)
        try:
            answer = await self.carry_out(request)
        except UserError as fault:
            answer = {"error": str(fault)}
        if number is not None:
            await self.send(messages.text({"answer": number if isinstance(number, int) else 0, **answer}))
        return ""

    async def carry_out(self, request: dict[str, Any]) -> dict[str, Any]:
        """Carry out a request of the page. UserError for an impossible one."""
        what = request.get("do")
        if what == "shown":
            if self.unshown > 0:
                self.allowance += 1.0  # a confirmation that keeps the pace is not counted as a request
                self.unshown -= 1
            self.shown.set()
            return {}
        if what == "look":
            self.set_view(request)
            return {}
        if what == "values":
            channels = channels_of(request.get("channels"), self.source)
            return {"values": self.source.values(channels, seconds(request.get("at"), "at"))}
        if what == "compare":
            self.comparison.start(request.get("walk"))
            return {}
        if what == "stop comparing":
            await self.comparison.stop()
            return {}
        return await self.source.request(request)

    def set_view(self, request: dict[str, Any]) -> None:
        """Set all plots of the page, and its cursor."""
        plots = request.get("plots")
        if not isinstance(plots, list) or len(plots) > MOST_PLOTS:
            raise UserError(f"look: a list of up to {MOST_PLOTS} plots is expected")
        found = {}
        for number, plot in enumerate(plots):
            if not isinstance(plot, dict):
                raise UserError(f"look: plot {number} is not an object")
            found[number] = Plot(
                channels_of(plot.get("channels"), self.source),
                seconds(plot.get("begin"), "begin"),
                seconds(plot.get("end"), "end"),
                seconds(plot.get("span"), "span") or 10.0,
                points_of(plot.get("points")),
            )
        for number, shown in self.plots.items():
            if number in found and found[number].choices() == shown.choices():
                found[number].sent_s = shown.sent_s
        hidden = channels_of(request.get("hidden", []), self.source)
        if sum(len(plot.channels) for plot in found.values()) + len(hidden) > MOST_CHANNELS:
            raise UserError(f"look: {MOST_CHANNELS} channels at a time are possible")
        self.plots = found
        before, self.wanted = self.wanted, {*hidden, *(each for plot in found.values() for each in plot.channels)}
        if before != self.wanted:
            self.wants()
        self.at = seconds(request.get("at"), "at")
        self.changed.set()

    # --- data for the page ----------------------------------------------------------------------------------

    async def show(self) -> None:
        """Send pictures as fast as the page shows them, on average at most 33 a second."""
        loop = asyncio.get_running_loop()
        live = "live" in self.source.can
        due_s = loop.time()
        while True:
            self.changed.clear()
            renews = live or self.source.is_coming
            await self.send(messages.picture(self.picture(loop.time())))
            self.unshown += 1
            while self.unshown >= AHEAD:
                self.shown.clear()
                await self.shown.wait()
            due_s = max(due_s + PICTURE_S, loop.time() - PICTURE_S)  # makes up for one late picture, not more
            if live and self.at is None and not self.source.lost:
                await asyncio.sleep(max(0.0, due_s - loop.time()))
            else:
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(STATE_S if renews else None):
                        await self.changed.wait()

    def picture(self, now_s: float) -> list[bytes]:
        """The messages of one picture."""
        begin, end = self.source.span()
        found = []
        for number, plot in self.plots.items():
            first, points, window = plot.next(end, self.source.late_s)
            traces = [self.source.trace(channel, first, window.end, points) for channel in plot.channels]
            found.append(messages.traces(number, window, plot.channels, traces))
        pose = self.source.pose(self.at)
        if pose is not None:
            found.append(messages.pose(*pose))
        if self.at is not None:  # the values at the cursor; the traces have the extremes over a pixel's time
            channels = sorted({channel for plot in self.plots.values() for channel in plot.channels})
            values = dict(zip(channels, self.source.values(channels, self.at), strict=True))
            found.append(messages.text({"values": values, "at": self.at}))
        if now_s >= self.next_state_s or self.at is not None:
            self.next_state_s = now_s + STATE_S
            state = {**self.source.state(self.at), "twins": self.comparison.content}
            found.append(messages.text({"state": state}))
        found.append(messages.text({"picture": self.source.span(), "lost": self.source.lost}))
        return found


class Plot:
    """A plot of the page: `begin` to `end`, or the last `span` seconds while both are None.

    sent_s: the newest time when the page last received it, s; None before the first time.
    """

    def __init__(self, channels: list[int], begin: float | None, end: float | None, span: float, points: int) -> None:
        self.channels, self.begin, self.end, self.points = channels, begin, end, points
        self.span = min(max(span, 1e-3), 36_000.0)
        self.sent_s: float | None = None

    def choices(self) -> tuple[Any, ...]:
        """The page's settings of this plot; if they change, the plot is sent whole."""
        return self.channels, self.begin, self.end, self.span, self.points

    def next(self, newest: float, late_s: float) -> tuple[float, int, messages.Window]:
        """The part that the page does not have: its begin (s), its number of points, and the window it belongs to.

        Samples that may have arrived late, up to `late_s` before the last message, are sent again, and so is the last
        point, which was not complete.
        """
        if self.begin is not None and self.end is not None:
            return self.begin, self.points, messages.Window(self.end, self.end - self.begin, self.points, 0)
        sent_s, self.sent_s = self.sent_s, newest
        begin, width = newest - self.span, self.span / self.points
        if sent_s is not None and sent_s <= newest:
            points = math.ceil((newest - sent_s + late_s) / width - 1e-6) + 1
            if points < self.points:
                window = messages.Window(newest, self.span, self.points, messages.FOLLOWS)
                return newest - points * width, points, window
        return begin, self.points, messages.Window(newest, self.span, self.points, messages.FOLLOWS | messages.ANEW)


def channels_of(wanted: Any, source: Source) -> list[int]:
    """Check channel numbers. UserError for anything but numbers of existing channels."""
    if not isinstance(wanted, list):
        raise UserError("channels: a list of numbers is expected")
    for each in wanted:
        if isinstance(each, bool) or not isinstance(each, int) or not 0 <= each < len(source.channels):
            raise UserError(f"channels: {str(each)[:20]} is not 0 to {len(source.channels) - 1}")
    return wanted


def seconds(value: Any, what: str) -> float | None:
    """A time in a message, s; None if absent. UserError for anything but a finite number."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or abs(value) > 1e9:
        raise UserError(f"{what}: {str(value)[:20]} is not a time in seconds")
    return float(value)


def points_of(value: Any) -> int:
    """The number of points that a plot can show."""
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= MOST_POINTS:
        raise UserError(f"points: {str(value)[:20]} is not 1 to {MOST_POINTS}")
    return value


def new_token() -> str:
    """An unguessable token; its value does not affect any run."""
    return os.urandom(16).hex()
