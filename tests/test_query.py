"""Options after a source's name: read by what each is, and refused with what there is."""

from __future__ import annotations

import pytest

from tracker.errors import SourceError
from tracker.sources.query import number, numbers, read_query, some, whole, yes_or_no

READERS = {"frames": whole(1, 100), "noise": number(0, 5, "0 is clean")}
MORE = {"topic": some, "loud": yes_or_no, "size": numbers("w", "h")}


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


def test_text_answers_and_several_numbers_are_read() -> None:
    assert read_query("cam:7", "topic=/a/b&loud=yes&size=1,2.5", MORE) == {
        "topic": "/a/b",
        "loud": True,
        "size": (1, 2.5),
    }
    assert read_query("cam:7", "loud=no", MORE) == {"loud": False}


@pytest.mark.parametrize(
    ("query", "complaint"),
    [
        ("topic=", "topic='': expected something after the equals sign"),
        ("loud=maybe", "loud='maybe': expected yes or no"),
        ("size=1", "size='1': expected 2 numbers w,h"),
        ("size=1,x", "expected 2 numbers w,h"),
        ("size=1,inf", "expected 2 numbers w,h"),
    ],
)
def test_text_answers_and_several_numbers_are_refused_too(query: str, complaint: str) -> None:
    with pytest.raises(SourceError, match=complaint):
        read_query("cam:7", query, MORE)
