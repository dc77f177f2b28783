"""Where the page is served, by whom it may be called, and who is let in."""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from dataclasses import dataclass
from urllib.parse import urlsplit

from tracker.errors import ConfigError, OutputError

LOOPBACK = "127.0.0.1"
EVERYWHERE = ("0.0.0.0", "::")  # noqa: S104 - recognised, not bound
LEAST_TOKEN = 16  # characters


@dataclass(frozen=True, slots=True)
class Address:
    """host: a name or an address, without the brackets of IPv6. port: 0 for any that is free."""

    host: str
    port: int

    @property
    def loopback(self) -> bool:
        """Whether this machine alone can reach it."""
        return self.host == "localhost" or _is_loopback(self.host)

    def url(self, port: int) -> str:
        """What a browser is given; port: the one that was free. Where all addresses are served, the machine's name."""
        host = socket.gethostname() if self.host in EVERYWHERE else self.host
        return f"http://{Address(host, port)}/"

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


@dataclass(frozen=True, slots=True)
class Gate:
    """Lets in who calls the page by a name of its own and knows the token.

    A page of somebody else that has its name point here (DNS rebinding) still calls by that name, and so is told apart
    by the Host header; one that calls by our name is told apart by the Origin header, which browsers add.
    """

    address: Address
    token: str | None

    def knows(self, host: str) -> bool:
        """Whether the Host header is a name of this page: an address, or a name of this machine."""
        name = _name_in(host)
        if self.address.loopback:
            return name == "localhost" or _is_loopback(name)
        own = socket.gethostname().lower()
        return _is_ip(name) or name in {"localhost", self.address.host.lower(), own, f"{own}.local"}

    def same_origin(self, origin: str, host: str) -> bool:
        """Whether the Origin header is of a page that came from this one, which was called by the Host header."""
        scheme, separator, netloc = origin.lower().partition("://")
        return bool(separator) and scheme in ("http", "https") and netloc == host.lower()

    def opens_with(self, token: str | None) -> bool:
        """Takes as long for every wrong token."""
        return self.token is None or hmac.compare_digest(_bytes(token or ""), _bytes(self.token))


def parse_address(text: str) -> Address:
    """ "HOST:PORT", "[IPv6]:PORT", or "PORT" for this machine alone. Raises ConfigError for anything else."""
    host, separator, port = text.rpartition(":")
    host = host if separator else LOOPBACK
    if host.startswith("[") and host.endswith("]") and _is_ip(host[1:-1]):
        host = host[1:-1]
    elif ":" in host or "[" in host:  # an IPv6 address has brackets, a name has none
        host = ""
    if not host or not port.isdecimal() or not port.isascii() or int(port) > 65535:
        raise ConfigError(f"--serve {text}: expected HOST:PORT, [IPv6]:PORT or PORT, as in 127.0.0.1:8080")
    return Address(host, int(port))


def gate_of(address: Address, token: str | None) -> Gate:
    """token: one that was given, and then is always needed. Where there is none, this machine alone needs none, and for
    others one is made. Raises ConfigError for a token that could be guessed."""
    if token is not None and len(token) < LEAST_TOKEN:
        raise ConfigError(f"the page's token has {len(token)} characters; expected at least {LEAST_TOKEN}")
    if token is None and not address.loopback:
        token = secrets.token_urlsafe(24)
    return Gate(address, token)


def listen(address: Address) -> socket.socket:
    """Raises OutputError where the port is taken, or the host is none of this machine's."""
    try:
        family, _, _, _, place = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_STREAM)[0]
        return socket.create_server(place[:2], family=family)
    except (OSError, UnicodeError) as error:  # the latter of a host that can be no name
        why = str(getattr(error, "strerror", error)).partition(" (while")[0]
        raise OutputError(
            f"--serve {address}: cannot listen there ({why}); give another port or host, or port 0 for any that is free"
        ) from error


def _name_in(host: str) -> str:
    """A Host header without its port; "" where it is none."""
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""


def _bytes(token: str) -> bytes:
    return token.encode(errors="backslashreplace")  # a header may hold what is no text


def _is_ip(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _is_loopback(name: str) -> bool:
    return _is_ip(name) and ipaddress.ip_address(name).is_loopback
