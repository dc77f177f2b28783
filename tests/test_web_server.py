"""The page over HTTP and websocket: who gets in, what is sent, what is asked for, and how it ends."""

from __future__ import annotations

import asyncio
import json
import logging
import re
import socket
import threading
import time
import zipfile
from collections.abc import Callable, Coroutine
from dataclasses import replace
from io import BytesIO
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

from tests.test_overlay import T_CAM_OBJ, plain, result
from tests.web_page import LONG_S, Caller, called, served
from tracker.errors import ConfigError
from tracker.pointing import Click, Pointer
from tracker.remote_control import RemoteControl
from tracker.saliency import Saliency
from tracker.view import Box, ObjectView
from tracker.web.guard import COOKIE
from tracker.web.server import MOST_BROWSERS, WebPage

aiohttp = pytest.importorskip("aiohttp")

TOKEN = "a token that nobody guesses"  # noqa: S105


def shown(page: WebPage, index: int = 0) -> None:
    frame = replace(plain(90, index), stamp_ns=index * 33_333_333)
    page.show(frame, [result(T_CAM_OBJ)], {})


def answer_of(page: WebPage, path: str = "/", **headers: str) -> tuple[int, Any, bytes]:
    """Status, headers, content; redirections are not followed."""

    async def get() -> tuple[int, Any, bytes]:
        async with (
            aiohttp.ClientSession() as session,
            session.get(page.url.rstrip("/") + path, headers=headers, allow_redirects=False) as response,
        ):
            return response.status, response.headers, await response.read()

    return asyncio.run(get())


def talk(page: WebPage, how: Callable[[Caller], Coroutine[Any, Any, None]], **headers: str) -> None:
    async def whole() -> None:
        async with called(page, **headers) as caller:
            await how(caller)

    asyncio.run(asyncio.wait_for(whole(), LONG_S))


def socket_status(page: WebPage, **headers: str) -> int:
    """Of the answer to a browser that would open a websocket; 101 where it may."""
    try:
        talk(page, lambda _: asyncio.sleep(0), **headers)
    except aiohttp.WSServerHandshakeError as refusal:
        return refusal.status
    return 101


# Who gets in


def test_the_page_is_whole_in_one_file_and_may_fetch_nothing_elsewhere() -> None:
    with served() as page:
        status, headers, content = answer_of(page)
    text = content.decode()
    assert (status, headers["Content-Type"]) == (200, "text/html; charset=utf-8")
    fetched = re.findall(r"https?://[^\"]*|@import|url\(|src=\"//", text)
    assert fetched == ["http://www.w3.org/2000/svg"]  # which is a name and not fetched
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert policy.count("sha256-") == text.count("<script") + text.count("<style")
    assert (headers["X-Content-Type-Options"], headers["Referrer-Policy"]) == ("nosniff", "no-referrer")


PATHS = ("/", "/socket", "/poses.jsonl", "/recording.zip", "/concepts", "/concept.jpg")


@pytest.mark.parametrize("path", PATHS)
def test_another_name_for_this_machine_is_refused_everywhere(path: str) -> None:
    with served() as page:
        assert answer_of(page, path, Host="evil.example")[0] == 403
        assert answer_of(page, path, Origin="http://evil.example")[0] == 403


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 101),
        ({"Host": "evil.example", "Origin": "http://evil.example"}, 403),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
    ],
)
def test_a_websocket_is_for_the_page_itself(headers: dict[str, str], status: int) -> None:
    with served() as page:
        assert socket_status(page, **headers) == status


def test_a_websocket_without_an_origin_is_refused() -> None:
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13"}
    with served() as page:
        assert answer_of(page, "/socket", **upgrade, **{"Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA=="})[0] == 403


def test_what_another_site_has_a_browser_fetch_is_refused() -> None:
    with served() as page:
        shown(page)
        for path in PATHS[2:4]:
            assert answer_of(page, path, **{"Sec-Fetch-Site": "cross-site"})[0] == 403
        assert answer_of(page, "/poses.jsonl", **{"Sec-Fetch-Site": "same-origin"})[0] == 200
        assert answer_of(page, "/", **{"Sec-Fetch-Site": "cross-site"})[0] == 200  # a link to it


@pytest.mark.parametrize("path", PATHS)
def test_without_the_token_nothing_is_told(path: str) -> None:
    with served(token=TOKEN) as page:
        for headers in ({}, {"Cookie": f"{COOKIE}=another"}, {"Cookie": f'{COOKIE}="\udc80"'}):
            try:
                status, _, content = answer_of(page, path, **headers)
            except UnicodeEncodeError:  # this client cannot say that
                continue
            assert status == 401
            assert TOKEN.encode() not in content
        assert answer_of(page, f"{path}?token=another")[0] == 401
        assert socket_status(page) == 401


def test_the_token_in_the_address_is_exchanged_for_a_cookie() -> None:
    with served(token="token-of-24-letters-or-so") as page:  # noqa: S106
        status, headers, _ = answer_of(page, "/?token=token-of-24-letters-or-so")
        assert (status, headers["Location"]) == (303, "/")
        cookie = headers["Set-Cookie"]
        assert "HttpOnly" in cookie
        assert "SameSite=Strict" in cookie
        assert answer_of(page, "/", Cookie=cookie.partition(";")[0])[0] == 200
        assert socket_status(page, Cookie=cookie.partition(";")[0]) == 101


def test_a_token_is_in_no_log(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG)
    with served(token="token-of-24-letters-or-so") as page:  # noqa: S106
        answer_of(page, "/?token=token-of-24-letters-or-so")
        answer_of(page, "/poses.jsonl?token=token-of-24-letters-or-so")
        socket_status(page, Cookie=f"{COOKIE}=token-of-24-letters-or-so")
    assert "token-of-24" not in caplog.text


def test_beyond_this_machine_there_is_a_token_and_names_are_still_checked() -> None:
    with served(host="0.0.0.0") as page:  # noqa: S104
        port = urlsplit(page.url).port
        page_here = f"127.0.0.1:{port}"
        assert answer_at(page_here) == 401
        assert answer_at(page_here, Host="evil.example") == 403


def answer_at(place: str, **headers: str) -> int:
    async def get() -> int:
        async with aiohttp.ClientSession() as session, session.get(f"http://{place}/", headers=headers) as response:
            return response.status

    return asyncio.run(get())


# What is sent


def test_a_browser_is_sent_the_newest_frame_with_its_poses() -> None:
    with served() as page:
        for index in range(3):
            shown(page, index)

        async def look(caller: Caller) -> None:
            status = await caller.status()
            assert (status["status"], status["objects"], status["title"]) == ("running", ["thing"], "test:scene")
            header, picture = await caller.picture()
            assert picture.startswith(b"\xff\xd8")
            assert (header["frame"], header["size"], header["all_samples"]) == (2, [320, 240], True)
            assert [sample[1] for sample in header["samples"]] == [[["tracking", 0.87]]] * 3
            assert header["rows"][0]["object"] == "thing"
            await asyncio.to_thread(shown, page, 3)
            header, _ = await caller.picture()
            assert (header["frame"], header["all_samples"], len(header["samples"])) == (3, False, 1)

        talk(page, look)


def test_a_browser_that_does_not_look_is_sent_no_more_and_then_the_newest() -> None:
    with served() as page:

        async def look(caller: Caller) -> None:
            await caller.status()
            for index in range(2):
                await asyncio.to_thread(shown, page, index)
                assert (await caller.picture())[0]["frame"] == index
            for index in range(2, 40):
                await asyncio.to_thread(shown, page, index)
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(caller.picture(), 0.3)
            await caller.say(seen=True)
            header, _ = await caller.picture()
            assert header["frame"] == 39
            assert len(header["samples"]) == 38  # the chart has them all

        talk(page, look)


def test_showing_waits_for_nobody_and_draws_for_nobody_when_nobody_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = threading.Event()
    go_on = threading.Event()

    def slow(*_: object) -> bytes:
        drawn.set()
        go_on.wait(LONG_S)
        return b"\xff\xd8"

    monkeypatch.setattr("tracker.web.server.overlay_picture", slow)
    with served() as page:
        shown(page, 0)
        assert not drawn.is_set()

        async def look(caller: Caller) -> None:
            await asyncio.to_thread(drawn.wait, LONG_S)
            for index in range(1, 200):  # comes to an end although no picture does
                shown(page, index)
            go_on.set()
            assert (await caller.picture())[0]["frame"] == 0
            assert (await caller.picture())[0]["frame"] == 199

        talk(page, look)


def test_two_browsers_are_sent_one_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[int] = []
    monkeypatch.setattr("tracker.web.server.overlay_picture", lambda s, _: drawn.append(s.number) or b"\xff\xd8")
    with served() as page:

        async def both() -> None:
            async with called(page) as first, called(page) as second:
                await asyncio.to_thread(shown, page)
                for caller in (first, second):
                    assert (await caller.picture())[1] == b"\xff\xd8"

        asyncio.run(both())
    assert drawn == [1]


def test_pictures_are_not_compressed_twice() -> None:
    with served() as page:

        async def offer() -> None:
            headers = {"Origin": page.url.rstrip("/")}
            async with aiohttp.ClientSession() as session:
                there = await session.ws_connect(f"{page.url}socket", headers=headers, compress=15)
                assert there.compress == 0

        asyncio.run(offer())


def test_one_browser_too_many_is_told() -> None:
    with served() as page:

        async def many() -> None:
            async with aiohttp.ClientSession() as session:
                headers = {"Origin": page.url.rstrip("/")}
                there = [await session.ws_connect(f"{page.url}socket", headers=headers) for _ in range(MOST_BROWSERS)]
                with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
                    await session.ws_connect(f"{page.url}socket", headers=headers)
                assert refused.value.status == 503
                await there.pop().close()
                await session.ws_connect(f"{page.url}socket", headers=headers)

        asyncio.run(many())


def test_the_poses_and_the_last_seconds_can_be_downloaded() -> None:
    with served() as page:
        assert answer_of(page, "/recording.zip")[0] == 404
        for index in range(3):
            shown(page, index)
        status, headers, content = answer_of(page, "/poses.jsonl")
        assert (status, headers["Content-Disposition"]) == (200, 'attachment; filename="poses.jsonl"')
        assert [json.loads(line)["frame"] for line in content.splitlines()] == [0, 1, 2]
        assert "Content-Security-Policy" in headers
        for _ in range(400):
            status, headers, content = answer_of(page, "/recording.zip")
            if status == 200 and len(zipfile.ZipFile(BytesIO(content)).namelist()) == 7:
                break
        names = zipfile.ZipFile(BytesIO(content)).namelist()
        assert min(name.partition("/")[2] for name in names) == "cam_K.txt"
        assert len(names) == 7


def test_the_concepts_that_were_asked_for_can_be_looked_at(can_view: ObjectView) -> None:
    saliency = Saliency(("red & <b>", "round"), np.array([[[0.1]], [[0.8]]], np.float32).repeat(4, 1), can_view.box)
    with served(last_answer=lambda name: (can_view, saliency) if name == "thing" else None) as page:
        told = json.loads(answer_of(page, "/concepts?object=thing")[2])
        assert told["frame"] == can_view.frame.index
        assert [label for label, _ in told["labels"]] == ["round", "red & <b>"]
        status, headers, picture = answer_of(page, "/concept.jpg?object=thing&label=red+%26+%3Cb%3E")
        assert (status, headers["Content-Type"], picture[:2]) == (200, "image/jpeg", b"\xff\xd8")
        assert answer_of(page, "/concept.jpg?object=thing&label=blue")[0] == 404
        assert answer_of(page, "/concept.jpg?object=other&label=round")[0] == 404
        assert json.loads(answer_of(page, "/concepts?object=other")[2]) == {"frame": None, "labels": []}


# What is asked for


class Pointed:
    def __init__(self) -> None:
        self.told: list[tuple[str, Pointer]] = []

    def point_out(self, object_id: str, there: Pointer) -> None:
        if object_id != "thing":
            raise ConfigError(f"there is no model of object {object_id!r}; there are thing")
        self.told.append((object_id, there))


def test_a_box_and_a_click_reach_the_loop_and_refusals_come_back() -> None:
    remote, tracker = RemoteControl(), Pointed()
    with served(remote) as page:
        shown(page)

        async def ask(caller: Caller) -> None:
            questions: list[tuple[str, list[Any]]] = [
                ("thing", [10, 20, 60, 70]),
                ("thing", [319, 239]),
                ("other", [1, 1]),
                ("thing", [320, 0]),
                ("thing", [-50, -50, 0, 0]),
                ("thing", [10, 20, 10, 70]),
                ("thing", ["1", None]),
                ("thing", [1.5, 2.5]),
            ]
            expected = ("", "", "no model of object 'other'", "outside", "outside", *["points nowhere"] * 3)
            for number, ((object_id, at), error) in enumerate(zip(questions, expected, strict=True)):
                await caller.say(id=number, object=object_id, at=at)
                answer = asyncio.create_task(caller.answer(number))
                while not answer.done():
                    remote.carry_out(tracker)
                    await asyncio.sleep(0.005)
                assert error in await answer
                assert bool(error) == bool(await answer)

        talk(page, ask)
    assert tracker.told == [("thing", Box(10, 20, 60, 70)), ("thing", Click(319, 239))]


def test_every_browser_is_told_that_it_is_paused() -> None:
    remote = RemoteControl()
    with served(remote) as page:

        async def both() -> None:
            async with called(page) as first, called(page) as second:
                for caller in (first, second):
                    await caller.status(status="running")
                await first.say(pause=True)
                for caller in (first, second):
                    await caller.status(status="paused")
                assert remote.paused
                await second.say(pause=False)
                await first.status(status="running")

        asyncio.run(both())
    assert not remote.paused


def test_why_nothing_can_be_pointed_out_is_told() -> None:
    with served(cannot_point="every frame's mask says where it is") as page:

        async def look(caller: Caller) -> None:
            assert (await caller.status())["cannot_point"] == "every frame's mask says where it is"

        talk(page, look)


@pytest.mark.parametrize("message", ["", "{", "[]", '{"pause": 1}', '{"id": "1"}', "[" * 3000, '{"a": "' + "x" * 5000])
def test_who_talks_nonsense_is_hung_up_on_and_nobody_else(message: str) -> None:
    with served() as page:

        async def both() -> None:
            async with called(page) as good, called(page) as bad:
                await bad.socket.send_str(message)
                while (await bad.socket.receive(timeout=LONG_S)).type is aiohttp.WSMsgType.TEXT:
                    pass
                assert bad.socket.close_code in (1008, 1009)
                await asyncio.to_thread(shown, page)
                await good.picture()

        asyncio.run(both())


# How it ends


def test_closing_says_goodbye_frees_the_port_and_leaves_no_thread() -> None:
    before = threading.active_count()
    remote = RemoteControl()
    with served(remote) as page:
        port = urlsplit(page.url).port

        async def look(caller: Caller) -> None:
            await caller.status()
            await asyncio.to_thread(page.close)
            message = await caller.socket.receive(timeout=LONG_S)
            while message.type is aiohttp.WSMsgType.TEXT:
                message = await caller.socket.receive(timeout=LONG_S)
            assert (message.type, message.data) == (aiohttp.WSMsgType.CLOSE, 1001)

        talk(page, look)
        page.close()
    assert threading.active_count() == before
    with pytest.raises(ConfigError, match="has ended"):
        remote.point_out("thing", Click(1, 1)).result(0)
    socket.create_server(("127.0.0.1", port or 0)).close()


def test_a_browser_that_takes_nothing_does_not_hold_up_the_end() -> None:
    with served() as page:
        for index in range(3):
            shown(page, index)
        stuck = socket.create_connection(("127.0.0.1", urlsplit(page.url).port or 0))
        stuck.sendall(b"GET /recording.zip HTTP/1.1\r\nHost: localhost\r\n\r\n")
        half = socket.create_connection(("127.0.0.1", urlsplit(page.url).port or 0))
        half.sendall(b"GET / HT")
        time.sleep(0.05)
    assert not any(thread.name == "web page" for thread in threading.enumerate())
    stuck.close()
    half.close()


def test_staying_tells_that_there_are_no_more_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    remote = RemoteControl()
    with served(remote) as page:
        monkeypatch.setattr("tracker.web.server.threading.Event.wait", lambda _: None)
        page.stay("there are no more frames")
        monkeypatch.undo()

        async def look(caller: Caller) -> None:
            await caller.status(status="ended")

        talk(page, look)
        with pytest.raises(ConfigError, match="no more frames"):
            remote.point_out("thing", Click(1, 1)).result(0)
