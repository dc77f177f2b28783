"""Who does not get in, and what a browser is told not to do with what it gets."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING

from tracker.web.address import Gate

if TYPE_CHECKING:
    from aiohttp.typedefs import Middleware
    from aiohttp.web import Request, StreamResponse

COOKIE = "conceptrack_token"
CLOSED = (
    "This page needs its token: open it once by the address that was printed with it, http://HOST:PORT/?token=TOKEN\n"
)


def guard(gate: Gate) -> Middleware:
    """Lets through what `refusal` has nothing against and who has the token, in a cookie; the token in the address of
    the page is exchanged for the cookie, so that it stays in no history."""
    from aiohttp import web

    @web.middleware
    async def let_in(request: Request, handler: Callable[[Request], Awaitable[StreamResponse]]) -> StreamResponse:
        why_not = refusal(gate, request)
        if why_not:
            return web.Response(status=403, text=f"{why_not}\n")
        told = request.query.get("token")
        if request.path == "/" and told is not None and gate.opens_with(told):
            answer = web.Response(status=303, headers={"Location": "/"})
            if gate.token is not None:
                answer.set_cookie(COOKIE, gate.token, httponly=True, samesite="Strict", path="/")
            return answer
        if not gate.opens_with(request.cookies.get(COOKIE)):
            return web.Response(status=401, text=CLOSED)
        return await handler(request)

    return let_in


def refusal(gate: Gate, request: Request) -> str:
    """Why a request is of somebody else's page, "" where it is not."""
    host, origin = request.headers.get("Host", ""), request.headers.get("Origin")
    if not gate.knows(host):
        return f"this page is not called {host!r}"
    if origin is not None and not gate.same_origin(origin, host):
        return f"{origin!r} is another page"
    if origin is None and request.headers.get("Upgrade"):
        return "a websocket needs the header Origin"
    if request.path != "/" and request.headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin"):
        return "this was asked for by another page"
    return ""


def safe_headers(page: str) -> dict[str, str]:
    """Nothing is fetched from elsewhere, no script runs but those of the page itself, and nobody frames it."""
    allowed = {
        kind: " ".join(f"'sha256-{_sha256(text)}'" for text in re.findall(rf"<{tag}>(.*?)</{tag}>", page, re.DOTALL))
        for kind, tag in (("script-src", "script"), ("style-src", "style"))
    }
    rules = {"default-src": "'none'", "connect-src": "'self'", "img-src": "'self' data:", **allowed}
    rules |= {"frame-ancestors": "'none'", "base-uri": "'none'", "form-action": "'none'"}
    return {
        "Content-Security-Policy": "; ".join(f"{kind} {value}" for kind, value in rules.items()),
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cache-Control": "no-store",
    }


def _sha256(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
