"""`python -m tracker --serve`: the link that is printed, what is refused, and how it ends."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

import tracker.__main__
from tests.web_page import LONG_S, Caller
from tracker.web import TOKEN_VARIABLE

aiohttp = pytest.importorskip("aiohttp")

SCENE = "synthetic:turn?size=160x120&object=soup_can"
TOKEN = "a-token-that-nobody-guesses"  # noqa: S105
Run = Callable[..., tuple[int, str]]


@pytest.fixture
def run(can_file: Path, program: Callable[..., tuple[int, str]]) -> Run:
    """`python -m tracker` in this process: its exit code and what it says."""

    def call(*options: object, frames: int = 4) -> tuple[int, str]:
        return program(tracker.__main__.main, f"{SCENE}&frames={frames}", "--model", can_file, *options)

    return call


@pytest.fixture
def port() -> int:
    """One that is free."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        return int(free.getsockname()[1])


def meanwhile(port: int, status: str, *messages: dict[str, object]) -> threading.Thread:
    """A browser that comes when the page is there, says this, and presses ctrl-C once the page has that status."""

    async def come() -> None:
        here = f"http://127.0.0.1:{port}"
        async with aiohttp.ClientSession() as session:
            while True:
                try:
                    open_socket = await session.ws_connect(f"{here}/socket", headers={"Origin": here})
                    break
                except aiohttp.ClientConnectorError:
                    await asyncio.sleep(0.01)
            async with open_socket:
                for message in messages:
                    await open_socket.send_json(message)
                await Caller(open_socket).status(status=status)
                await asyncio.sleep(0.1)

    def whole() -> None:
        try:
            asyncio.run(asyncio.wait_for(come(), LONG_S))
        finally:
            os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=whole)
    thread.start()
    return thread


def test_the_page_stays_when_the_frames_end_and_ctrl_c_ends_it_with_everything_written(
    run: Run, port: int, tmp_path: Path
) -> None:
    before = threading.active_count()
    browser = meanwhile(port, "ended")
    code, said = run("--serve", port, "--out", tmp_path / "out", "--view", "overlay")
    browser.join()
    assert code == 0, said
    assert f"the page: http://127.0.0.1:{port}/ " in said
    assert "the page stays until ctrl-C" in said
    assert "stopped; what was tracked is kept" in said
    lines = [json.loads(line) for line in (tmp_path / "out" / "poses.jsonl").read_text().splitlines()]
    assert [line["frame"] for line in lines] == [0, 1, 2, 3]
    assert (tmp_path / "out" / "overlay.mp4").stat().st_size > 0
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert threading.active_count() == before


def test_ctrl_c_ends_a_tracker_that_is_paused(run: Run, port: int) -> None:
    browser = meanwhile(port, "paused", {"pause": True})
    code, said = run("--serve", port, frames=500)
    browser.join()
    assert (code, "stopped" in said, "no more frames" in said) == (0, True, False), said


def test_a_port_that_is_taken_is_a_sentence(run: Run) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code, said = run("--serve", f"127.0.0.1:{port}")
    assert code == 1
    assert f"error: --serve 127.0.0.1:{port}: cannot listen there (Address already in use)" in said


@pytest.mark.parametrize("address", ["nowhere", "127.0.0.1:http", "127.0.0.1:8080:8080"])
def test_what_is_no_address_is_a_sentence(address: str, run: Run) -> None:
    code, said = run("--serve", address)
    assert (code, "expected HOST:PORT" in said) == (1, True)


def test_a_token_that_is_given_is_not_printed(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(TOKEN_VARIABLE, TOKEN)
    monkeypatch.setattr("tracker.web.server.WebPage.stay", lambda *_: None)
    code, said = run("--serve", "0.0.0.0:0")
    assert code == 0
    assert "the page: http://" in said
    assert (TOKEN in said, "token=" in said) == (False, False)
    monkeypatch.setenv(TOKEN_VARIABLE, "short")
    code, said = run("--serve", "0")
    assert (code, "expected at least 16" in said) == (1, True)


def test_a_token_that_is_made_is_printed_once(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(TOKEN_VARIABLE, raising=False)
    monkeypatch.setattr("tracker.web.server.WebPage.stay", lambda *_: None)
    code, said = run("--serve", "0.0.0.0:0")
    assert code == 0
    assert said.count("/?token=") == 1


def test_without_the_extra_it_is_named(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    code, said = run("--serve", "0")
    assert code == 1
    assert "pip install 'conceptrack[web]'" in said
