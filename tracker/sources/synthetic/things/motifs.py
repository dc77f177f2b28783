"""What prints are made of: bar codes, tables, small print, sunbursts, leaves. Places and sizes in millimetres."""

from __future__ import annotations

import numpy as np

from tracker.sources.synthetic.things.drawing import Rgb, Sheet

INK: Rgb = (28, 26, 30)
PAPER: Rgb = (246, 243, 235)
SYLLABLES = (
    "ba",
    "so",
    "len",
    "ti",
    "mor",
    "ve",
    "ka",
    "ru",
    "din",
    "pel",
    "os",
    "ta",
    "mi",
    "ga",
    "flo",
    "cor",
    "ben",
)
FACTS = (("Energy", "378 kcal"), ("Fat", "6.1 g"), ("Carbohydrate", "68 g"), ("Sugars", "9 g"), ("Fibre", "8.4 g"),
         ("Protein", "11 g"), ("Salt", "0.7 g"), ("Iron", "12 mg"))  # fmt: skip


def barcode(sheet: Sheet, x_mm: float, y_mm: float, width_mm: float, height_mm: float, seed: int) -> None:
    """Black bars on a white field with digits below."""
    rng = np.random.default_rng(seed)
    sheet.rectangle(x_mm, y_mm, width_mm, height_mm, (255, 255, 255))
    edges = np.cumsum(rng.choice([0.35, 0.35, 0.7, 1.05], int(width_mm * 2.2)))
    edges = x_mm + 2 + edges[edges < width_mm - 4]
    for left, right in zip(edges[::2], edges[1::2], strict=False):
        sheet.rectangle(left, y_mm + 1.5, right - left, height_mm - 6, INK)
    digits = "".join(str(d) for d in rng.integers(0, 10, 12))
    sheet.text(digits, x_mm + width_mm / 2, y_mm + height_mm - 2.4, 2.2, INK, width_mm - 4, "plain")


def facts(sheet: Sheet, x_mm: float, y_mm: float, width_mm: float, ink: Rgb = INK, rows: int = 8) -> None:
    """A nutrition table of `rows` lines, 4.2 mm a line."""
    height_mm = 9 + 4.2 * rows
    sheet.rectangle(x_mm - 0.5, y_mm - 0.5, width_mm + 1, height_mm + 1, ink)
    sheet.rectangle(x_mm, y_mm, width_mm, height_mm, PAPER)
    sheet.text("Nutrition", x_mm + width_mm / 2, y_mm + 4, 4, INK, width_mm - 3)
    sheet.rectangle(x_mm + 1, y_mm + 7.2, width_mm - 2, 0.9, INK)
    for row, (name, amount) in enumerate(FACTS[:rows]):
        y = y_mm + 10.5 + 4.2 * row
        sheet.text(name, x_mm + 1.5, y, 2, INK, width_mm * 0.5, "plain", flush_left=True)
        sheet.text(amount, x_mm + width_mm * 0.8, y, 2, INK, width_mm * 0.3, "plain")
        sheet.rectangle(x_mm + 1, y + 1.9, width_mm - 2, 0.2, INK)


def small_print(
    sheet: Sheet, x_mm: float, y_mm: float, width_mm: float, lines: int, ink: Rgb, seed: int, line_mm: float = 3.4
) -> None:
    """A paragraph of made-up words, ragged on the right."""
    rng = np.random.default_rng(seed)
    for line in range(lines):
        words = ["".join(rng.choice(SYLLABLES, rng.integers(1, 4))) for _ in range(round(width_mm / line_mm / 2))]
        width = width_mm * (0.6 if line == lines - 1 else 1.0)
        sheet.text(" ".join(words), x_mm, y_mm + line * line_mm, line_mm * 0.5, ink, width, "plain", flush_left=True)


def sunburst(sheet: Sheet, x_mm: float, y_mm: float, rays: int, colour: Rgb) -> None:
    """Rays from (x, y) to beyond the sheet."""
    reach = sheet.width_mm + sheet.height_mm
    for ray in range(rays):
        angles = (ray + np.array([-0.25, 0.25])) * 2 * np.pi / rays
        ends = [(x_mm + reach * float(np.cos(a)), y_mm + reach * float(np.sin(a))) for a in angles]
        sheet.polygon([(x_mm, y_mm), *ends], colour)


def leaf(sheet: Sheet, x_mm: float, y_mm: float, length_mm: float, turn_deg: float, colour: Rgb, vein: Rgb) -> None:
    """A leaf that starts at (x, y) and points along `turn_deg` (0 is right, 90 is down)."""
    along = np.linspace(0, 1, 17)
    width = 0.23 * np.sin(np.pi * along**0.8)
    outline = np.concatenate((np.stack((along, width), 1), np.stack((along, -width), 1)[::-1])) * length_mm
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    turn = np.array([[c, s], [-s, c]])
    sheet.polygon((outline @ turn + [x_mm, y_mm]).tolist(), colour)
    ribs = [[(0.0, 0.0), (0.95, 0.0)]]
    ribs += [[(t, 0.0), (t + 0.14, side * 0.13)] for t in (0.25, 0.42, 0.6) for side in (-1, 1)]
    for rib in ribs:
        sheet.line((np.array(rib) * length_mm @ turn + [x_mm, y_mm]).tolist(), vein, max(0.25, length_mm * 0.02))


def star(sheet: Sheet, x_mm: float, y_mm: float, radius_mm: float, points: int, inner: float, colour: Rgb) -> None:
    """A star or a seal: `inner` is the share of the radius to which its notches go."""
    angles = np.arange(2 * points) * np.pi / points - np.pi / 2
    radii = radius_mm * np.where(np.arange(2 * points) % 2, inner, 1.0)
    outline = np.stack((x_mm + radii * np.cos(angles), y_mm + radii * np.sin(angles)), axis=1)
    sheet.polygon(outline.tolist(), colour)


def ribbon(
    sheet: Sheet, x_mm: float, y_mm: float, width_mm: float, height_mm: float, sag_mm: float, colour: Rgb
) -> None:
    """A curved banner centred at (x, y) whose middle is `sag_mm` higher than its ends."""
    across = np.linspace(-0.5, 0.5, 33)
    middle = y_mm - sag_mm * (1 - (2 * across) ** 2)
    top = np.stack((x_mm + across * width_mm, middle - height_mm / 2), 1)
    bottom = np.stack((x_mm + across * width_mm, middle + height_mm / 2), 1)
    sheet.polygon(np.concatenate((top, bottom[::-1])).tolist(), colour)
