"""Tables and lists of a page, whose cells are any text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape

from eval.report_text import plain

WORDS = {"data", "reason", "images"}  # columns that may wrap


def html_table(
    heading: Sequence[str],
    rows: Iterable[Sequence[str]],
    totals: Iterable[Sequence[str]] = (),
    groups: Sequence[tuple[str, int]] = (),
) -> str:
    """A table that sorts by a click on a heading. totals: rows that stay at its foot. groups: what stands above the
    headings, each over so many of them."""
    wraps = [name in WORDS for name in heading]

    def drawn(rows: Iterable[Sequence[str]]) -> str:
        cells = ([_cell(name, words) for name, words in zip(row, wraps, strict=True)] for row in rows)
        return "".join(f"<tr>{''.join(row)}</tr>" for row in cells)

    buttons = "".join(
        f'<th scope="col" aria-sort="none"{" class=words" if words else ""}>'
        f'<button type="button">{escape(name)}</button></th>'
        for name, words in zip(heading, wraps, strict=True)
    )
    above = "".join(f'<th scope="colgroup" colspan="{columns}">{escape(name)}</th>' for name, columns in groups)
    head = f"{f'<tr>{above}</tr>' if above else ''}<tr>{buttons}</tr>"
    foot = f"<tfoot>{total}</tfoot>" if (total := drawn(totals)) else ""
    return (
        f'<div class="wide"><table class="sortable"><thead>{head}</thead>'
        f"<tbody>{drawn(rows)}</tbody>{foot}</table></div>"
    )


def definitions(values: Mapping[str, object]) -> str:
    """Names and what is said of each."""
    pairs = (f"<dt>{escape(k)}</dt><dd>{escape(plain(v))}</dd>" for k, v in values.items())
    return f"<dl>{''.join(pairs)}</dl>"


def _cell(text: str, words: bool) -> str:
    return f'<td class="words">{escape(text)}</td>' if words else f"<td>{escape(text)}</td>"
