"""A headless Chromium, driven by the Chrome DevTools protocol."""

from __future__ import annotations

import asyncio
import base64
import os
import re
import shutil
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
LONG_S = 30.0


def find_chromium() -> str | None:
    """On the PATH, or where Playwright puts it."""
    kept = sorted((Path.home() / ".cache" / "ms-playwright").glob("chromium*/chrome-*/chrome"))
    return next(filter(None, map(shutil.which, NAMES)), str(kept[-1]) if kept else None)


class Page:
    """One tab. complaints: what its console and its scripts had to complain of."""

    def __init__(self, socket: Any) -> None:
        self._socket, self._number = socket, 0
        self._answers: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._reading = asyncio.create_task(self._read())
        self._loaded = asyncio.Event()
        self.complaints: list[str] = []

    async def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        answer = self._answers[self._number] = asyncio.get_running_loop().create_future()
        await self._socket.send_json({"id": self._number, "method": method, "params": parameters})
        return await asyncio.wait_for(answer, LONG_S)

    async def open(self, url: str, width: int = 1000, height: int = 900) -> None:
        for domain in ("Page", "Runtime", "Log", "Network"):
            await self.ask(f"{domain}.enable")
        await self.ask(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False
        )
        self._loaded.clear()
        await self.ask("Page.navigate", url=url)
        await asyncio.wait_for(self._loaded.wait(), LONG_S)

    async def reload(self) -> None:
        self._loaded.clear()
        await self.ask("Page.reload")
        await asyncio.wait_for(self._loaded.wait(), LONG_S)

    async def value(self, expression: str) -> Any:
        """Of JavaScript; what a promise comes to."""
        told = await self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in told, told
        return told["result"].get("value")

    async def until(self, expression: str, within_s: float = LONG_S) -> None:
        """The expression is true."""
        async with asyncio.timeout(within_s):
            while not await self.value(expression):
                await asyncio.sleep(0.05)

    async def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """With the left button, in pixels of the window."""
        button = {"button": "left", "clickCount": 1}
        await self.ask("Input.dispatchMouseEvent", type="mousePressed", x=start[0], y=start[1], **button)
        for share in (0.5, 1.0):
            x, y = (a + (b - a) * share for a, b in zip(start, end, strict=True))
            await self.ask("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, button="left", buttons=1)
        await self.ask("Input.dispatchMouseEvent", type="mouseReleased", x=end[0], y=end[1], **button)

    async def picture(self) -> bytes:
        """PNG of the whole page, also of what the window does not show."""
        shot = await self.ask("Page.captureScreenshot", format="png", captureBeyondViewport=True)
        return base64.b64decode(shot["data"])

    def close(self) -> None:
        self._reading.cancel()

    async def _read(self) -> None:
        async for message in self._socket:
            told = message.json()
            method, what = told.get("method"), told.get("params", {})
            if "id" in told:
                self._answers.pop(told["id"]).set_result(told.get("result", told))
            elif method == "Page.loadEventFired":
                self._loaded.set()
            elif method == "Runtime.exceptionThrown":
                self.complaints.append(str(what["exceptionDetails"]))
            elif method == "Runtime.consoleAPICalled" and what["type"] in ("error", "warning"):
                self.complaints.append(str(what["args"]))
            elif method == "Log.entryAdded" and what["entry"]["level"] in ("error", "warning"):
                self.complaints.append(what["entry"]["text"])


@asynccontextmanager
async def browser(chromium: str, profile: Path) -> AsyncIterator[Page]:
    """A tab of a browser of its own. profile: an empty folder."""
    import aiohttp

    # root may not use the sandbox; the page is the test's own
    sandbox = ["--no-sandbox"] if os.geteuid() == 0 else []
    options = ["--headless=new", "--remote-debugging-port=0", f"--user-data-dir={profile}", "--disable-gpu"]
    options += ["--no-first-run", "--disable-dev-shm-usage", "--remote-allow-origins=*", *sandbox, "about:blank"]
    process = subprocess.Popen([chromium, *options], stderr=subprocess.PIPE, text=True)  # noqa: S603
    try:
        port = await asyncio.wait_for(asyncio.to_thread(_port_of, process), LONG_S)
        async with aiohttp.ClientSession() as session:
            async with session.get(f"http://127.0.0.1:{port}/json/list") as listed:
                tabs = await listed.json()
            url = next(tab["webSocketDebuggerUrl"] for tab in tabs if tab["type"] == "page")
            async with session.ws_connect(url, max_msg_size=0) as socket:
                page = Page(socket)
                try:
                    yield page
                finally:
                    page.close()
                    with suppress(TimeoutError, ConnectionError):
                        await asyncio.wait_for(socket.send_json({"id": 0, "method": "Browser.close"}), 1)
    finally:
        process.terminate()
        process.communicate()


def _port_of(process: subprocess.Popen[str]) -> int:
    assert process.stderr is not None
    for line in process.stderr:
        if found := re.search(r"DevTools listening on ws://127\.0\.0\.1:(\d+)/", line):
            return int(found[1])
    raise AssertionError(f"{process.args} does not start")
