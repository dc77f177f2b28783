"""When errors happen, and what the tracker said at that time: a figure a scene."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from itertools import groupby, pairwise

import numpy as np

from eval.frame_record import FrameRecord
from eval.instances import InstanceError
from eval.plots.figure import Panel, figure, rect, shortened, text

LEAST_MM, LARGEST_MM = 0.5, 100.0
TICKS_MM = (1, 10, 100)
LEFT, ROW = 82, 16
# Okabe and Ito, Color Universal Design, 2008, without black and the yellow that white paper swallows
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8a6d3b", "#808080")
STATES = {"tracking": "var(--faint)", "lost": "var(--ink)", "initialising": "var(--quiet)"}  # the hues are the objects'


def error_over_time(rows: Sequence[InstanceError], records: Sequence[FrameRecord]) -> str:
    """ADD of every instance over the images; missing poses and errors over 10 cm are on the upper edge, those
    under 0.5 mm on the lower one.

    Under it, where there are records, the confidence and the state of every object.
    """
    figures = []
    for scene_id in sorted({row.scene_id for row in rows}):
        errors = [row for row in rows if row.scene_id == scene_id]
        said = sorted((r for r in records if r.scene_id == scene_id), key=lambda r: (r.object_id, r.image_id))
        figures.append(_scene(scene_id, errors, said))
    return "\n".join(figures)


def _scene(scene_id: int, errors: Sequence[InstanceError], records: Sequence[FrameRecord]) -> str:
    images = [each.image_id for each in (*errors, *records)]
    span = min(images), max(images) + 1
    objects = sorted({each.object_id for each in (*errors, *records)})
    colours = {name: COLOURS[k % len(COLOURS)] for k, name in enumerate(objects)}
    ticks = np.unique(np.linspace(span[0], span[1] - 1, 4).round()).tolist()
    above = Panel(span, (LEAST_MM, LARGEST_MM), left=LEFT, bottom=150, logarithmic=True)
    marks = above.grid(() if records else ticks, TICKS_MM, "" if records else "image", "ADD, mm")
    for name in objects:
        marks.append(f'<g fill="{colours[name]}" fill-opacity=".75">')
        marks += [_dot(above, row) for row in errors if row.object_id == name]
        marks.append("</g>")
    key = [(colours[name], name) for name in objects]
    if not records:
        return figure(f"Scene {scene_id}", marks, 190, key)
    middle = Panel(span, (0, 1), left=LEFT, top=182, bottom=232)
    marks += middle.grid((), (0, 0.5, 1), y_name="confidence")
    bottom = Panel(span, (0, 1), left=LEFT, top=244, bottom=244 + ROW * len(objects))
    for name, group in groupby(records, key=lambda record: record.object_id):
        steps = list(group)
        marks.append(middle.line([r.image_id for r in steps], [r.confidence for r in steps], colours[name]))
        y = bottom.top + ROW * objects.index(name)
        marks.append(text(LEFT - 6, y + ROW - 4, shortened(name, 10), "end"))
        for state, first, end in _spans(steps, span[1]):
            left = bottom.across(first)
            said = f"{name}: {state} from image {first} on"
            marks.append(rect(left, y + 2, bottom.across(end) - left, ROW - 4, STATES[state], said))
    marks += bottom.grid(ticks, (), "image")
    key += [(colour, f"is {state}") for state, colour in STATES.items() if any(r.state == state for r in records)]
    return figure(f"Scene {scene_id}", marks, bottom.bottom + 40, key)


def _dot(panel: Panel, row: InstanceError) -> str:
    mm = row.add_m * 1000
    error = "no pose" if row.missing else f"{mm:.1f} mm"
    said = escape(f"{row.object_id}, image {row.image_id}: {error}")
    return f'<circle cx="{panel.across(row.image_id):.1f}" cy="{panel.up(mm):.1f}" r="2"><title>{said}</title></circle>'


def _spans(steps: Sequence[FrameRecord], end: int) -> Iterator[tuple[str, int, int]]:
    """State, first image, and the image at which another state begins."""
    firsts = [next(group) for _, group in groupby(steps, key=lambda record: record.state)]
    for record, following in pairwise([*firsts, None]):
        if record is not None:
            yield record.state, record.image_id, end if following is None else following.image_id
