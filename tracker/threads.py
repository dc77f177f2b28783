"""How many threads torch works with, and which threads come after others."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import torch

NICENESS = 10  # on a busy core, a ninth of what others get


def give_way() -> None:
    """From here on the calling thread, and those that it starts, get little time where the cores are busy, so that what
    must not wait does not wait for it. Where the system has no priorities of threads nothing changes."""
    if sys.platform == "linux":
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Within, torch computes on so many threads; afterwards as before."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


@contextmanager
def one_thread() -> Iterator[None]:
    """Within, torch computes on the calling thread alone; afterwards as before.

    For many operations on small tensors: sharing them out gains next to nothing, and where other work holds a core,
    every operation waits for the thread that does not get to run.
    """
    with torch_threads(1):
        yield
