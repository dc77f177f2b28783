"""Where and in which precision a network runs."""

from __future__ import annotations

import time
from functools import cache

import torch

from tracker.errors import ConfigError


def torch_device(name: str) -> torch.device:
    """ "auto" is CUDA where there is one. Raises ConfigError where the device does not exist here."""
    name = ("cuda" if torch.cuda.is_available() else "cpu") if name == "auto" else name
    try:
        torch.empty(0, device=name)
    except (RuntimeError, AssertionError) as error:
        raise ConfigError(f"device {name!r} cannot be used here: {str(error).splitlines()[0]}") from error
    return torch.device(name)


def precision(device: torch.device) -> torch.dtype:
    """fp16 on CUDA; elsewhere whichever of fp32 and bf16 is faster on this machine."""
    if device.type == "cuda":
        return torch.float16
    return torch.bfloat16 if device.type == "cpu" and _bf16_is_faster() else torch.float32


@cache
def _bf16_is_faster() -> bool:
    """By a product of a transformer's size: processors without bf16 units emulate them, many times slower."""
    fastest = {}
    for dtype in (torch.float32, torch.bfloat16):
        a, b = torch.ones(256, 768, dtype=dtype), torch.ones(768, 1536, dtype=dtype)
        fastest[dtype] = min(_seconds(a, b) for _ in range(5))
    return fastest[torch.bfloat16] < 0.8 * fastest[torch.float32]


def _seconds(a: torch.Tensor, b: torch.Tensor) -> float:
    start = time.perf_counter()
    torch.matmul(a, b)
    return time.perf_counter() - start
