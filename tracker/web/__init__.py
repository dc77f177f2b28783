"""A live page: video with poses, how sure they are over time, and where the concepts are; objects can be pointed out.

`open_page("127.0.0.1:8080", ...)` gives a `tracker.viewer.Viewer`. aiohttp (extra `web`) is imported when it is opened.

    a browser                the page's thread                        the tracker's thread
    page.html  <- socket ->  client: newest frame, as it is taken  <-  board       <- viewer.show(frame, results)
               -> point out, pause                                 ->  remote control -> carried out between two frames
               <- downloads: poses, concepts, the last seconds     <-  ring, compressed in a thread of its own
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tracker.errors import MissingExtraError

if TYPE_CHECKING:
    from tracker.concept import ConceptModel
    from tracker.config import TrackerConfig
    from tracker.pipeline import ObjectTracker
    from tracker.remote_control import RemoteControl
    from tracker.web.server import WebPage

TOKEN_VARIABLE = "CONCEPTRACK_TOKEN"  # noqa: S105 - the name of a variable
CANNOT_POINT = (
    "Every frame's mask says where the objects are, so none can be pointed out. Start the tracker with --masks carried "
    "to do that."
)
__all__ = ["TOKEN_VARIABLE", "OpenedPage", "open_page"]


@dataclass(frozen=True, slots=True)
class OpenedPage:
    """link: what to open in a browser; it holds the token where that was made here."""

    page: WebPage
    link: str


def open_page(
    address: str,
    token: str | None,
    title: str,
    tracker: ObjectTracker,
    models: Sequence[ConceptModel],
    config: TrackerConfig,
    remote: RemoteControl,
) -> OpenedPage:
    """address: HOST:PORT or PORT. token: who has it may see the page; None makes one where others than this machine
    could call it. title: the name of the source. remote: what the page asks of the loop.

    Raises MissingExtraError without aiohttp, ConfigError for an address or a token that cannot be meant, OutputError
    where the port is taken.
    """
    from tracker.overlay import shapes_of
    from tracker.web.address import gate_of, parse_address
    from tracker.web.server import WebPage

    try:
        import aiohttp  # noqa: F401
    except ImportError as error:
        raise MissingExtraError(f"the page needs aiohttp ({error}): pip install 'conceptrack[web]'") from error
    gate = gate_of(parse_address(address), token)
    cannot_point = "" if config.masks == "carried" else CANNOT_POINT
    page = WebPage(gate, title, shapes_of(models), remote, tracker.last_answer, cannot_point)
    made_here = gate.token if token is None else None
    return OpenedPage(page, f"{page.url}?token={made_here}" if made_here else page.url)
