"""Threads are given back, whatever happens within."""

from __future__ import annotations

import os
import sys
import threading

import pytest
import torch

from tracker.threads import NICENESS, give_way, one_thread


def test_one_within_and_as_before_afterwards() -> None:
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        with one_thread():
            assert torch.get_num_threads() == 1
        assert torch.get_num_threads() == 2
        with pytest.raises(ZeroDivisionError), one_thread():
            raise ZeroDivisionError
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)


@pytest.mark.skipif(sys.platform != "linux", reason="threads have no priorities of their own here")
def test_a_thread_that_gives_way_is_alone_in_that() -> None:
    before = os.getpriority(os.PRIO_PROCESS, threading.get_native_id())
    told: list[int] = []

    def give() -> None:
        give_way()
        told.append(os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))

    other = threading.Thread(target=give)
    other.start()
    other.join()
    assert told == [NICENESS]
    assert os.getpriority(os.PRIO_PROCESS, threading.get_native_id()) == before
