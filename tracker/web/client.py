"""One browser: what it is sent, as fast as it takes it, and what it asks for."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Awaitable, Callable, Mapping
from typing import TYPE_CHECKING, Any

from tracker.errors import ConfigError, TrackerError
from tracker.pointing import Click, Pointer, parse_pointer
from tracker.remote_control import RemoteControl
from tracker.view import Box
from tracker.web.board import Board, Shown, as_row, as_sample, packet
from tracker.web.last_seconds import Extent

if TYPE_CHECKING:
    from aiohttp.web import WebSocketResponse

MOST_PICTURES_HZ = 30.0
ON_THE_WAY = 2  # pictures that the browser has not said to have seen; with more they would be old when they come
MOST_QUESTIONS = 8  # of one browser that wait for the next frame


class Client:
    """pictures: a frame -> its JPEG, made once for all browsers. status: what the page says of the whole run.
    extent: of what could be saved. woken: to be set when there is a new frame, or another status."""

    def __init__(
        self,
        socket: WebSocketResponse,
        board: Board,
        remote: RemoteControl,
        pictures: Callable[[Shown], Awaitable[bytes]],
        status: Callable[[], Mapping[str, Any]],
        extent: Callable[[], Extent],
    ) -> None:
        self._socket, self._board, self._remote = socket, board, remote
        self._pictures, self._status, self._extent = pictures, status, extent
        self._number, self._on_the_way, self._told = 0, 0, ""
        self._questions: set[asyncio.Task[None]] = set()
        self.woken = asyncio.Event()
        self.woken.set()

    async def show(self) -> None:
        """The newest frame, as often as it changes and the browser keeps up; those between are left out."""
        next_s = 0.0
        while True:
            await self.woken.wait()
            self.woken.clear()
            await self._tell_status()
            if self._board.newest is None or self._on_the_way >= ON_THE_WAY:
                continue
            await asyncio.sleep(next_s - time.monotonic())
            # a frame that came a little late does not make the next one late, too
            next_s = max(next_s + 1 / MOST_PICTURES_HZ, time.monotonic() + 0.5 / MOST_PICTURES_HZ)
            if self._board.newest.number != self._number:
                await self._send(self._board.newest)

    def hear(self, text: str) -> None:
        """A message of the browser: {"seen": true}, {"pause": true} or {"id", "object", "at": [x, y] or [x0, y0, x1,
        y1]}. Raises ConfigError for anything else."""
        try:
            asked = json.loads(text)
        except (ValueError, RecursionError):
            asked = None
        match asked:
            case {"seen": True}:
                self._on_the_way = max(self._on_the_way - 1, 0)
                self.woken.set()
            case {"pause": bool(paused)}:
                self._remote.pause(paused)
            case {"id": int(number), "object": str(object_id), "at": [*at]} if len(self._questions) < MOST_QUESTIONS:
                question = asyncio.create_task(self._point_out(number, object_id, at))
                self._questions.add(question)
                question.add_done_callback(self._questions.discard)
            case _:
                raise ConfigError(f"{text[:80]!r} is nothing that can be asked for")

    def close(self) -> None:
        """Answers that did not come in time come no more."""
        for question in self._questions:
            question.cancel()

    async def _send(self, shown: Shown) -> None:
        picture = await self._pictures(shown)
        camera, extent = shown.frame.intrinsics, self._extent()
        header = {
            "frame": shown.frame.index,
            "size": [camera.width, camera.height],
            "rate_hz": round(self._board.rate_hz(), 1),
            "saved": {"frames": extent.frames, "seconds": extent.seconds, "megabytes": extent.megabytes},
            "rows": [as_row(result) for result in shown.results],
            "samples": [as_sample(past) for past in self._board.since(self._number)],
            "all_samples": self._number == 0,
        }
        self._number = shown.number
        self._on_the_way += 1
        await self._socket.send_bytes(packet(header, picture))

    async def _tell_status(self) -> None:
        told = json.dumps(self._status(), allow_nan=False)
        if told != self._told:
            self._told = told
            await self._socket.send_str(told)

    async def _point_out(self, number: int, object_id: str, at: list[Any]) -> None:
        error = ""
        try:
            await asyncio.wrap_future(self._remote.point_out(object_id, self._pointer(at)))
        except TrackerError as refusal:
            error = str(refusal)
        await self._socket.send_str(json.dumps({"answer": number, "error": error}))

    def _pointer(self, at: list[Any]) -> Pointer:
        """Within the picture. Raises ConfigError where it is not."""
        there = parse_pointer(",".join(map(str, at[:5])))
        newest = self._board.newest
        if newest is None:
            raise ConfigError("there is no picture yet to point at")
        width, height = newest.frame.intrinsics.width, newest.frame.intrinsics.height
        if isinstance(there, Click) and 0 <= there.column < width and 0 <= there.row < height:
            return there
        if isinstance(there, Box) and there.x0 < width and there.y0 < height and there.x1 > 0 and there.y1 > 0:
            return there
        raise ConfigError(f"{tuple(there)} is outside of the picture of {width} x {height} pixels")
