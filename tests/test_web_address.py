"""Where the page is, by which names it is called, and which tokens open it."""

from __future__ import annotations

import socket

import pytest

from tracker.errors import ConfigError, OutputError
from tracker.web.address import Address, Gate, gate_of, listen, parse_address

TOKEN = "a token that nobody guesses"  # noqa: S105
HERE, EVERYWHERE = Gate(Address("127.0.0.1", 8080), None), Gate(Address("0.0.0.0", 8080), TOKEN)  # noqa: S104


@pytest.mark.parametrize(
    ("text", "address", "loopback"),
    [
        ("8080", Address("127.0.0.1", 8080), True),
        ("127.0.0.1:0", Address("127.0.0.1", 0), True),
        ("localhost:80", Address("localhost", 80), True),
        ("[::1]:8080", Address("::1", 8080), True),
        ("127.8.9.1:8080", Address("127.8.9.1", 8080), True),
        ("0.0.0.0:8080", Address("0.0.0.0", 8080), False),  # noqa: S104
        ("robot.lan:65535", Address("robot.lan", 65535), False),
        ("localhost.evil.org:1", Address("localhost.evil.org", 1), False),
        ("[2001:db8::1]:8080", Address("2001:db8::1", 8080), False),
    ],
)
def test_an_address_is_a_host_and_a_port(text: str, address: Address, loopback: bool) -> None:
    assert parse_address(text) == address
    assert parse_address(text).loopback is loopback
    assert text.endswith(str(parse_address(text)).rpartition(":")[2])


@pytest.mark.parametrize(
    "text", ["", ":", ":8080", "host", "host:", "host:x", "host:65536", "::1:80", "[host]:80", "-1"]
)
def test_what_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="expected HOST:PORT"):
        parse_address(text)


@pytest.mark.parametrize(
    ("host", "here", "everywhere"),
    [
        ("127.0.0.1:8080", True, True),
        ("localhost:9000", True, True),  # a port that is forwarded
        ("[::1]:8080", True, True),
        ("192.168.1.7:8080", False, True),
        (f"{socket.gethostname()}:8080", False, True),
        ("evil.example:8080", False, False),
        ("127.0.0.1.evil.example:8080", False, False),
        ("localhost@evil.example", False, False),
        ("", False, False),
        ("[", False, False),
    ],
)
def test_a_name_that_anybody_may_point_here_is_not_ours(host: str, here: bool, everywhere: bool) -> None:
    assert (HERE.knows(host), EVERYWHERE.knows(host)) == (here, everywhere)


@pytest.mark.parametrize(
    ("origin", "same"),
    [
        ("http://127.0.0.1:8080", True),
        ("https://127.0.0.1:8080", True),  # behind a proxy
        ("http://127.0.0.1:3000", False),
        ("http://localhost:8080", False),
        ("http://evil.example", False),
        ("http://127.0.0.1:8080.evil.example", False),
        ("file://127.0.0.1:8080", False),
        ("null", False),
        ("", False),
    ],
)
def test_only_the_page_itself_has_its_origin(origin: str, same: bool) -> None:
    assert HERE.same_origin(origin, "127.0.0.1:8080") is same


def test_beyond_this_machine_a_token_is_made_and_no_two_are_alike() -> None:
    made = [gate_of(EVERYWHERE.address, None).token for _ in range(2)]
    assert all(token is not None and len(token) >= 32 for token in made)
    assert made[0] != made[1]
    assert gate_of(HERE.address, None).token is None


def test_a_token_that_is_given_is_needed_everywhere() -> None:
    for gate in (gate_of(HERE.address, TOKEN), gate_of(EVERYWHERE.address, TOKEN)):
        assert gate.opens_with(TOKEN)
        assert not any(map(gate.opens_with, (None, "", TOKEN[:-1], TOKEN + "x", "\udc80é")))
    assert HERE.opens_with(None)


def test_a_token_that_can_be_guessed_is_refused_and_not_repeated() -> None:
    with pytest.raises(ConfigError, match="has 7 characters; expected at least") as refused:
        gate_of(HERE.address, "hunter2")
    assert "hunter2" not in str(refused.value)


def test_a_port_that_is_taken_is_a_clear_error() -> None:
    with listen(Address("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(OutputError, match=rf"127.0.0.1:{port}: cannot listen there \(Address already in use\)"):
            listen(Address("127.0.0.1", port))
    listen(Address("127.0.0.1", port)).close()


def test_a_link_has_the_port_that_was_free_and_a_name_that_others_can_call() -> None:
    assert Address("::1", 0).url(8080) == "http://[::1]:8080/"
    assert EVERYWHERE.address.url(8080) == f"http://{socket.gethostname()}:8080/"
