"""Damage of text that keeps it text: other words and numbers in the place of those that are there."""

from __future__ import annotations

import re

from tests.fuzz.damage import Rng, damaged

BETWEEN_WORDS = re.compile(r"([\s,;:/\[\]{}\"]+)")
WORDS = (
    "", "0", "-1", "1", "7", "1.5", "-0.0", "nan", "inf", "-inf", "NaN", "Infinity", "1e309", "-1e308", "1e-320",
    "1e99",
    "2147483648", "-9223372036854775809", "9" * 30, "9" * 400, "1" * 5000, "1e999999999", "1e-999999999", "0x10",
    "1_000",
    "٣", "²", "½", "１２", "\0", "\u2028", "\ufeff", "é" * 300, "x" * 10_000, "'", '"', "#", "%s", "{}", "-", "--",
    ",", ",,,,",
    "..", "/", "../../../etc/passwd", "/etc/passwd", "/dev/zero", "/proc/self/mem", "~", "C:\\x",
    "file:///etc/passwd", "$HOME",
    "rgb", "depth", "../rgb", "null", "true", "None", "yes", "!!python/object/apply:os.system ['false']", "&a", "*a",
    "<<", "---",
    "2001-99-99", "0o8", "1:60:60", "=", "? a", "| ", "!!binary", "!!set", "!!int x", "!!float x", "!!timestamp x",
)  # fmt: skip


def reworded(data: bytes, rng: Rng) -> bytes:
    """Some words are exchanged, dropped, doubled, or take the place of others; some lines change places."""
    if rng.random() < 0.3:
        return damaged(data, rng)
    parts = BETWEEN_WORDS.split(data.decode())
    for _ in range(min(rng.geometric(0.6), 4)):
        k = int(rng.integers(len(parts)))
        what = rng.integers(6)
        if what <= 2:
            parts[k] = WORDS[rng.integers(len(WORDS))]
        elif what == 3:
            parts[k] = parts[rng.integers(len(parts))]
        elif what == 4:
            parts.insert(k, WORDS[rng.integers(len(WORDS))] + " ")
        else:
            parts[k] = ""
    lines = "".join(parts).split("\n")
    if rng.random() < 0.2:
        a, b = rng.integers(len(lines), size=2)
        lines[a] = lines[b] if rng.random() < 0.5 else lines[a] + lines[b]
    return "\n".join(lines).encode(errors="surrogatepass")
