"""A page that is served for a test, and who calls it."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from typing import Any

from tests.test_overlay import SHAPES
from tracker.remote_control import RemoteControl
from tracker.web.address import Address, gate_of
from tracker.web.downloads import LastAnswer
from tracker.web.server import WebPage

LONG_S = 20.0


@contextmanager
def served(
    remote: RemoteControl | None = None,
    token: str | None = None,
    host: str = "127.0.0.1",
    last_answer: LastAnswer = lambda _: None,
    cannot_point: str = "",
) -> Iterator[WebPage]:
    page = WebPage(
        gate_of(Address(host, 0), token), "test:scene", SHAPES, remote or RemoteControl(), last_answer, cannot_point
    )
    try:
        yield page
    finally:
        page.close()


class Caller:
    """A websocket to the page, as a browser has it."""

    def __init__(self, socket: Any) -> None:
        self.socket = socket

    async def status(self, **expected: Any) -> dict[str, Any]:
        """The next one that says so; pictures before it are seen."""
        while True:
            told = await self._next()
            if isinstance(told, dict) and "status" in told and expected.items() <= told.items():
                return told

    async def picture(self) -> tuple[dict[str, Any], bytes]:
        """Header and JPEG of the next one."""
        while True:
            told = await self._next()
            if isinstance(told, tuple):
                return told

    async def answer(self, number: int) -> str:
        """The error, "" where it was done."""
        while True:
            told = await self._next()
            if isinstance(told, dict) and told.get("answer") == number:
                return told["error"]

    async def say(self, **what: Any) -> None:
        await self.socket.send_json(what)

    async def _next(self) -> dict[str, Any] | tuple[dict[str, Any], bytes]:
        import aiohttp

        message = await self.socket.receive(timeout=LONG_S)
        if message.type is aiohttp.WSMsgType.TEXT:
            return json.loads(message.data)
        assert message.type is aiohttp.WSMsgType.BINARY, message
        length = int.from_bytes(message.data[:4], "little")
        return json.loads(message.data[4 : 4 + length]), message.data[4 + length :]


@asynccontextmanager
async def called(page: WebPage, **headers: str) -> AsyncIterator[Caller]:
    import aiohttp

    origin = page.url.rstrip("/")
    async with (
        aiohttp.ClientSession() as session,
        session.ws_connect(f"{page.url}socket", headers={"Origin": origin, **headers}) as socket,
    ):
        yield Caller(socket)
