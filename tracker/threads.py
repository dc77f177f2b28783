"""How many threads torch works with."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch


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
