"""What the page fetches beside the video: poses, the last seconds, and where the concepts were."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from typing import TYPE_CHECKING

from tracker.errors import TrackerError
from tracker.saliency import Saliency
from tracker.view import ObjectView
from tracker.web.board import Board
from tracker.web.last_seconds import LastSeconds, zipped
from tracker.web.pictures import concept_picture, strongest

if TYPE_CHECKING:
    from aiohttp.web import Application, Request, Response, StreamResponse

LastAnswer = Callable[[str], tuple[ObjectView, Saliency] | None]
PIECE_BYTES = 1 << 16


class Downloads:
    """last_answer: of an object, what `ObjectTracker.last_answer` says. workers: where pictures are made."""

    def __init__(self, board: Board, last_seconds: LastSeconds, last_answer: LastAnswer, workers: Executor) -> None:
        self._board, self._last_seconds = board, last_seconds
        self._last_answer, self._workers = last_answer, workers

    def add_to(self, app: Application) -> None:
        app.router.add_get("/poses.jsonl", self._poses)
        app.router.add_get("/recording.zip", self._recording)
        app.router.add_get("/concepts", self._concepts)
        app.router.add_get("/concept.jpg", self._concept)

    async def _poses(self, request: Request) -> StreamResponse:
        return await _sent(request, "poses.jsonl", "application/jsonl", map(str.encode, self._board.lines()))

    async def _recording(self, request: Request) -> StreamResponse:
        name = time.strftime("recording-%Y%m%d-%H%M%S")
        held = self._last_seconds.held()
        if not held:
            return _refused("there is no frame yet to be saved")
        return await _sent(request, f"{name}.zip", "application/zip", zipped(held, name))

    async def _concepts(self, request: Request) -> Response:
        """Of ?object=ID: the labels with the mean of their maps over the object, the highest first."""
        from aiohttp import web

        answer = self._last_answer(request.query.get("object", ""))
        if answer is None:
            return web.json_response({"frame": None, "labels": []})
        found = await asyncio.get_running_loop().run_in_executor(self._workers, strongest, *answer)
        return web.json_response({"frame": answer[0].frame.index, "labels": found})

    async def _concept(self, request: Request) -> Response:
        """Of ?object=ID&label=LABEL: the map as JPEG."""
        from aiohttp import web

        answer = self._last_answer(request.query.get("object", ""))
        if answer is None:
            return _refused("the concepts of this object were not asked for yet")
        loop, label = asyncio.get_running_loop(), request.query.get("label", "")
        try:
            picture = await loop.run_in_executor(self._workers, concept_picture, *answer, label)
        except TrackerError as error:
            return _refused(str(error))
        return web.Response(body=picture, content_type="image/jpeg")


async def _sent(request: Request, name: str, kind: str, pieces: Iterable[bytes]) -> StreamResponse:
    """A file to be saved, as fast as it is taken. Other browsers have their turn between the pieces."""
    from aiohttp import web

    response = web.StreamResponse(headers={"Content-Disposition": f'attachment; filename="{name}"'})
    response.content_type = kind
    await response.prepare(request)
    waiting = bytearray()
    for piece in pieces:
        waiting += piece
        if len(waiting) >= PIECE_BYTES:
            await response.write(bytes(waiting))
            waiting.clear()
            await asyncio.sleep(0)
    await response.write(bytes(waiting))
    await response.write_eof()
    return response


def _refused(why: str) -> Response:
    from aiohttp import web

    return web.Response(status=404, text=why + "\n")
