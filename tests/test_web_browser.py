"""The page in a browser: it shows the video, points objects out, and finds the tracker again. Without a Chromium on
this machine it is skipped."""

from __future__ import annotations

import asyncio
import itertools
import threading
from collections.abc import Callable, Coroutine
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.browser import LONG_S, Page, browser, find_chromium
from tracker.concept import ConceptModel
from tracker.config import TrackerConfig
from tracker.frame import Frame
from tracker.pipeline import ObjectTracker
from tracker.pointing import Pointer
from tracker.remote_control import RemoteControl
from tracker.saliency import SaliencyBackend
from tracker.view import Box, bounding_box
from tracker.web import CANNOT_POINT, open_page
from tracker.web.server import WebPage

pytest.importorskip("aiohttp")
CHROMIUM = find_chromium()
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on the PATH or in ~/.cache/ms-playwright")

STATE = "newest.rows[0].state"
VIDEO = "(b => [b.left, b.top, b.width, b.height])(video.getBoundingClientRect())"


class Run:
    """A tracker in a thread of its own that goes on through the same frames, and its page. pointed_out: what it was
    told, so far."""

    def __init__(
        self, model: ConceptModel, backend: SaliencyBackend, frames: list[Frame], masks: str, address: str = "0"
    ) -> None:
        config = TrackerConfig(masks=masks)  # pyright: ignore[reportArgumentType]
        self._tracker, self._config, self._frames = ObjectTracker(model, config, backend), config, frames
        self._model, self._remote, self._ended = model, RemoteControl(), False
        self.pointed_out: list[Pointer] = []
        self.page: WebPage = self.serve(address)
        self._thread = threading.Thread(target=self._loop)
        self._thread.start()

    def serve(self, address: str) -> WebPage:
        self.page = open_page(address, None, "test:can", self._tracker, [self._model], self._config, self._remote).page
        return self.page

    def point_out(self, object_id: str, there: Pointer) -> None:
        self._tracker.point_out(object_id, there)
        self.pointed_out.append(there)

    def close(self) -> None:
        self._ended = True
        self._remote.end("the test has ended")
        self._thread.join(LONG_S)
        self.page.close()

    def _loop(self) -> None:
        there_and_back = [*self._frames, *self._frames[::-1]]
        for index, frame in enumerate(itertools.cycle(there_and_back)):
            if self._ended:
                return
            frame = replace(frame, index=index, stamp_ns=index * 33_333_333)
            frame = frame if self._config.masks == "given" else replace(frame, masks={})
            self.page.show(frame, self._tracker.step(frame), {})
            self._remote.carry_out(self)


def look(tmp_path: Path, how: Callable[[Page], Coroutine[Any, Any, None]]) -> None:
    async def whole() -> None:
        assert CHROMIUM is not None
        async with browser(CHROMIUM, tmp_path) as page:
            await how(page)
            assert page.complaints == []

    asyncio.run(whole())


async def moves(page: Page) -> None:
    """Pictures come, and they are not all alike."""
    await page.until("newest !== null")
    frame = await page.value("window.before = video.toDataURL(), newest.frame")
    await page.until(f"newest.frame > {frame + 2} && video.toDataURL() !== window.before")


async def drawn(page: Page, box: Box) -> None:
    """Around what is in that box of the frame."""
    left, top, width, height = await page.value(VIDEO)
    columns, rows = await page.value("[video.width, video.height]")
    await page.value("document.getElementById('point').click()")
    x0, y0, x1, y1 = (
        left + box.x0 * width / columns, top + box.y0 * height / rows,
        left + box.x1 * width / columns, top + box.y1 * height / rows,
    )  # fmt: skip
    await page.drag((x0, y0), (x1, y1))


def test_the_video_moves_and_a_box_that_is_drawn_starts_the_tracker_anew(
    can_model: ConceptModel, can_frames: list[Frame], attributes: SaliencyBackend, tmp_path: Path
) -> None:
    seen = bounding_box(can_frames[0].masks["soup_can"])
    assert seen is not None
    around = Box(seen.x0 - 4, seen.y0 - 4, seen.x1 + 8, seen.y1 + 8)
    run = Run(can_model, attributes, can_frames[:4], "carried")

    async def point(page: Page) -> None:
        await page.open(run.page.url)
        await moves(page)
        await page.until(f"{STATE} === 'tracking'")
        await drawn(page, Box(4, 180, 60, 236))  # where it is not
        await page.until(f"{STATE} !== 'tracking'")
        await drawn(page, around)
        await page.until(f"{STATE} === 'tracking'")
        await page.until("document.getElementById('message').textContent.includes('looked for there')")
        assert len(run.pointed_out) == 2
        assert all(isinstance(there, Box) for there in run.pointed_out)
        assert max(abs(a - b) for a, b in zip(run.pointed_out[1], around, strict=True)) <= 2
        left, top, width, height = await page.value(VIDEO)
        await page.value("document.getElementById('point').click()")
        await page.drag((left + width / 2, top + height / 2), (left + width / 2, top + height / 2))
        await page.until("document.getElementById('message').textContent.includes('looked for there')")
        assert len(run.pointed_out[2]) == 2
        await page.value("document.getElementById('pause').click()")
        await page.until("document.getElementById('pause').textContent === 'Resume'")
        await page.until("document.querySelectorAll('#maps img').length > 0")

    try:
        look(tmp_path, point)
    finally:
        run.close()


def test_it_survives_a_reload_and_connects_again_by_itself(
    can_model: ConceptModel, can_frames: list[Frame], attributes: SaliencyBackend, tmp_path: Path
) -> None:
    run = Run(can_model, attributes, can_frames[:4], "given")

    async def lose(page: Page) -> None:
        await page.open(run.page.url, width=640)
        await moves(page)
        assert await page.value("document.getElementById('point').disabled")
        assert await page.value("document.getElementById('cannot').textContent") == CANNOT_POINT
        assert await page.value("document.documentElement.scrollWidth <= innerWidth")
        await page.reload()
        await moves(page)
        frame = await page.value("newest.frame")
        await page.value("socket.close()")
        await page.until(f"newest.frame > {frame + 5} && socket.readyState === 1")
        assert await page.value("document.getElementById('banner').hidden")
        assert page.complaints == []
        address = run.page.url.removeprefix("http://").rstrip("/")
        await asyncio.to_thread(run.page.close)  # the tracker is gone
        await page.until("!document.getElementById('banner').hidden")
        await asyncio.to_thread(run.serve, address)  # and comes back
        frame = await page.value("newest.frame")
        await page.until(f"newest.frame > {frame} && document.getElementById('banner').hidden")
        await moves(page)
        page.complaints = [text for text in page.complaints if "ERR_CONNECTION_REFUSED" not in text]

    try:
        look(tmp_path, lose)
    finally:
        run.close()
