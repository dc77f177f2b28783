"""Options after a source's name: read by what each is, and refused with what there is."""

from __future__ import annotations

import pytest

from tracker.errors import SourceError
from tracker.sources.query import number, read_query, whole

READERS = {"frames": whole(1, 100), "noise": number(0, 5, "0 is clean")}


def test_what_is_given_is_read() -> None:
    assert read_query("cam:7", "", READERS) == {}
    assert read_query("cam:7", "frames=60&noise=0.5", READERS) == {"frames": 60, "noise": 0.5}


@pytest.mark.parametrize(
    ("query", "complaint"),
    [
        ("colour=1", "cam:7: there is no option 'colour'; there is frames, noise"),
        ("frames=1&frames=2", "cam:7: option 'frames' is given twice"),
        ("frames=0", "cam:7: frames='0': expected a whole number from 1 to 100"),
        ("frames", "cam:7: frames='': expected a whole number"),
        ("frames=²", "frames='²': expected a whole number"),
        ("noise=6", "cam:7: noise='6': expected a number from 0 to 5, 0 is clean"),
        ("noise=nan", "noise='nan': expected a number"),
        ("noise=low", "noise='low': expected a number"),
    ],
)
def test_what_is_not_known_is_refused_with_what_there_is(query: str, complaint: str) -> None:
    with pytest.raises(SourceError, match=complaint):
        read_query("cam:7", query, READERS)
