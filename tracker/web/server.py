"""The page's server: a thread of its own, which the tracker's thread never waits for."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from importlib import resources
from typing import TYPE_CHECKING, Any

from tracker.errors import ConfigError
from tracker.frame import Frame
from tracker.geometry import Pose
from tracker.overlay import Shape
from tracker.remote_control import RemoteControl
from tracker.result import TrackResult
from tracker.web.address import Gate, listen
from tracker.web.board import Board, Shown
from tracker.web.client import Client
from tracker.web.downloads import Downloads, LastAnswer
from tracker.web.guard import guard, safe_headers
from tracker.web.last_seconds import LastSeconds
from tracker.web.pictures import overlay_picture

if TYPE_CHECKING:
    from aiohttp.web import Application, Request, Response, StreamResponse, WebSocketResponse

logger = logging.getLogger(__name__)

MOST_BROWSERS = 8
MOST_BYTES = 4096  # of a message of a browser
HEARTBEAT_S = 15.0  # a browser that is gone without a word is noticed
SHUTDOWN_S, PATIENCE_S = 1.0, 10.0


class WebPage:
    """A viewer in the browser, served from its making until `close`.

    gate: where, and for whom. title: what is tracked in, as the user wrote it. shapes: what is drawn of every object,
    by its id. last_answer: of an object, what `ObjectTracker.last_answer` says. cannot_point: why no object can be
    pointed out, "" where they can.
    Raises OutputError where the address is not free.
    """

    def __init__(
        self,
        gate: Gate,
        title: str,
        shapes: Mapping[str, Shape],
        remote: RemoteControl,
        last_answer: LastAnswer,
        cannot_point: str = "",
    ) -> None:
        self._gate, self._title, self._shapes, self._remote = gate, title, shapes, remote
        self._last_answer, self._cannot_point = last_answer, cannot_point
        self._listening = listen(gate.address)
        self._port = int(self._listening.getsockname()[1])
        self._board, self._last_seconds = Board(), LastSeconds()
        self._workers = ThreadPoolExecutor(1, "pictures")
        self._clients: dict[Client, WebSocketResponse] = {}
        self._picture: tuple[int, asyncio.Future[bytes]] | None = None
        self._stop, self._closed, self._paused = asyncio.Event(), False, False
        started: Future[asyncio.AbstractEventLoop] = Future()
        self._thread = threading.Thread(target=self._run, args=(started,), name="web page", daemon=True)
        self._thread.start()
        self._loop = started.result()

    @property
    def url(self) -> str:
        """Where a browser finds it; without the token."""
        return self._gate.address.url(self._port)

    def show(self, frame: Frame, results: Sequence[TrackResult], truth: Mapping[str, Pose]) -> None:
        self._last_seconds.put(frame)
        self._board.put(frame, results, truth)

    def stay(self, why: str) -> None:
        """When there are no more frames: until somebody presses ctrl-C. why: for those who still ask for something."""
        self._remote.end(why)
        self._loop.call_soon_threadsafe(self._wake)
        threading.Event().wait()

    def close(self) -> None:
        if self._closed:
            return
        self._closed = True
        self._remote.end("the tracker has ended")
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(PATIENCE_S)
        if self._thread.is_alive():
            logger.warning("the page's server does not end; it is left behind")
        self._last_seconds.close()
        self._workers.shutdown(cancel_futures=True)

    def _run(self, started: Future[asyncio.AbstractEventLoop]) -> None:
        try:
            asyncio.run(self._serve(started))
        except BaseException as error:
            if started.done():
                logger.exception("the page's server failed; the tracker goes on without it")
            else:
                started.set_exception(error)

    async def _serve(self, started: Future[asyncio.AbstractEventLoop]) -> None:
        from aiohttp import WSCloseCode, web

        # no access log: addresses may hold the token
        runner = web.AppRunner(self._app(), access_log=None, shutdown_timeout=SHUTDOWN_S)
        await runner.setup()
        await web.SockSite(runner, self._listening).start()
        started.set_result(asyncio.get_running_loop())
        await self._stop.wait()
        closing = [socket.close(code=WSCloseCode.GOING_AWAY) for socket in self._clients.values()]
        with suppress(TimeoutError):
            await asyncio.wait_for(asyncio.gather(*closing, return_exceptions=True), SHUTDOWN_S)
        await runner.cleanup()

    def _app(self) -> Application:
        from aiohttp import web

        page = resources.files("tracker.web").joinpath("page.html").read_text("utf-8")
        headers = safe_headers(page)

        async def show_page(_: Request) -> Response:
            return web.Response(text=page, content_type="text/html", charset="utf-8")

        async def add_headers(_: Request, answer: StreamResponse) -> None:
            answer.headers.update(headers)

        app = web.Application(middlewares=[guard(self._gate)])
        app.on_response_prepare.append(add_headers)
        app.router.add_get("/", show_page)
        app.router.add_get("/socket", self._socket)
        Downloads(self._board, self._last_seconds, self._last_answer, self._workers).add_to(app)
        return app

    async def _socket(self, request: Request) -> StreamResponse:
        from aiohttp import WSCloseCode, WSMsgType, web

        if len(self._clients) >= MOST_BROWSERS:
            return web.Response(status=503, text=f"{MOST_BROWSERS} browsers are connected already\n")
        # pictures are compressed already
        socket = web.WebSocketResponse(heartbeat=HEARTBEAT_S, max_msg_size=MOST_BYTES, compress=False)
        client = Client(socket, self._board, self._remote, self._overlay, self._status, self._last_seconds.extent)
        self._clients[client] = socket  # before anything is waited for, so that there are never too many
        self._board.listener = self._frame_came
        showing: asyncio.Task[None] | None = None
        try:
            await socket.prepare(request)
            showing = asyncio.create_task(self._show(client, socket))
            async for message in socket:
                if message.type is WSMsgType.TEXT:
                    client.hear(message.data)
                    if self._paused != self._remote.paused:  # all of them are to know
                        self._paused = self._remote.paused
                        self._wake()
        except ConfigError as error:
            await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=str(error).encode()[:100])
        finally:
            del self._clients[client]
            if not self._clients:
                self._board.listener = None
            client.close()
            if showing is not None:
                showing.cancel()
        return socket

    async def _show(self, client: Client, socket: WebSocketResponse) -> None:
        try:
            await client.show()
        except ConnectionError:
            logger.debug("a browser is gone")
        except Exception:
            logger.exception("a browser cannot be shown the frames")
            await socket.close()

    def _frame_came(self) -> None:
        """In the tracker's thread."""
        self._loop.call_soon_threadsafe(self._wake)

    def _wake(self) -> None:
        for client in self._clients:
            client.woken.set()

    async def _overlay(self, shown: Shown) -> bytes:
        """Made once, for whichever browser asks first."""
        if self._picture is None or self._picture[0] != shown.number:
            making = asyncio.get_running_loop().run_in_executor(self._workers, overlay_picture, shown, self._shapes)
            self._picture = shown.number, making
        return await asyncio.shield(self._picture[1])

    def _status(self) -> Mapping[str, Any]:
        answers = {object_id: self._last_answer(object_id) for object_id in self._shapes}
        return {
            "status": "ended" if self._remote.ended else "paused" if self._remote.paused else "running",
            "title": self._title,
            "objects": list(self._shapes),
            "cannot_point": self._cannot_point,
            "concepts": {object_id: answer and answer[0].frame.index for object_id, answer in answers.items()},
        }
