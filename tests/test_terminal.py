"""What programs say: a bar on terminals alone, tables unless they are to be quiet, errors always, JSON for others."""

from __future__ import annotations

import io
import json
import logging
import os
import re
import signal
import threading

import pytest
from rich.console import Console

from tracker import terminal
from tracker.errors import TrackerError
from tracker.terminal import hush, progress, run, say_json


@pytest.fixture
def screen(monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    """What is on a terminal, with its control codes."""
    screen = io.StringIO()
    monkeypatch.setattr(terminal, "STDERR", Console(file=screen, force_terminal=True, width=120))
    monkeypatch.setattr(terminal, "ALWAYS", Console(file=screen, force_terminal=True, width=120))
    return screen


def plain(text: str) -> str:
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text)


def test_the_bar_tells_how_far_it_is_how_fast_and_what_is_told(screen: io.StringIO) -> None:
    states = iter(["1 tracking", "1 lost", "2 lost"])
    with_bar = progress(range(3), 3, "looking", lambda: next(states))
    assert [item for item in with_bar] == [0, 1, 2]  # noqa: C416 - one by one, as frames come
    shown = plain(screen.getvalue())
    assert "looking" in shown
    assert "3/3" in shown
    assert "/s" in shown
    assert "2 lost" in shown


@pytest.mark.parametrize("quiet", [True, False])
def test_quiet_there_is_no_bar_and_no_table_but_warnings_and_errors(
    screen: io.StringIO, quiet: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging.getLogger(), "handlers", [])  # pytest's: with them no program adds its own

    def program() -> None:
        hush(quiet)
        list(progress(range(3), 3, "a bar"))
        terminal.STDERR.print("a table")
        logging.getLogger("some").warning("a warning")
        raise TrackerError("an error")

    with pytest.raises(SystemExit) as ended:
        run(program)
    assert ended.value.code == 1
    shown = plain(screen.getvalue())
    assert "error: an error" in shown
    assert "a warning" in shown
    assert ("a table" in shown, "a bar" in shown) == (not quiet, not quiet)


def test_one_program_that_is_quiet_does_not_silence_the_next(screen: io.StringIO) -> None:
    run(lambda: hush(True))
    run(lambda: terminal.STDERR.print("a table"))
    assert "a table" in screen.getvalue()


def test_into_a_pipe_goes_no_bar_and_no_control_code(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("FORCE_COLOR", "TTY_COMPATIBLE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(terminal, "STDERR", Console(stderr=True))
    monkeypatch.setattr(terminal, "ALWAYS", Console(stderr=True))

    def program() -> None:
        list(progress(range(3), 3, "a bar"))
        terminal.STDERR.print("[bold red]a table[/]")
        raise TrackerError("an error")

    with pytest.raises(SystemExit):
        run(program)
    said = capsys.readouterr().err
    assert said == "a table\nerror: an error\n"


def test_where_no_bar_can_be_drawn_a_line_now_and_then_tells_how_far_it_is(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(terminal, "STDERR", Console(stderr=True, force_terminal=False))
    monkeypatch.setattr(terminal, "LINE_EVERY_S", 0.0)
    assert list(progress("ab", 2, "looking", lambda: "1 lost")) == ["a", "b"]
    assert list(progress("c", None, "looking")) == ["c"]
    assert capsys.readouterr().err == "looking: 1 of 2 1 lost\nlooking: 2 of 2 1 lost\nlooking: 1\n"
    monkeypatch.setattr(terminal, "LINE_EVERY_S", 3600.0)
    assert list(progress("ab", 2, "looking")) == ["a", "b"]
    assert capsys.readouterr().err == ""


def test_json_is_one_line_that_can_be_read(capsys: pytest.CaptureFixture[str]) -> None:
    say_json({"a": [1.5, None], "b": "ü\n"})
    said = capsys.readouterr().out
    assert said.count("\n") == 1
    assert json.loads(said) == {"a": [1.5, None], "b": "ü\n"}
    with pytest.raises(ValueError, match="JSON"):
        say_json(float("nan"))


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_program_that_is_ended_says_so_and_how(screen: io.StringIO, sent: signal.Signals, code: int) -> None:
    def program() -> None:
        os.kill(os.getpid(), sent)
        threading.Event().wait(10)

    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(SystemExit) as ended:
        run(program)
    assert ended.value.code == code
    assert "stopped" in plain(screen.getvalue())
    assert signal.getsignal(signal.SIGTERM) is before
