"""The page's frame: its style, the script that sorts its tables, and the rule that nothing is fetched."""

from __future__ import annotations

from html import escape

# Whatever a name in the data looks like, the browser fetches nothing for it.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"

STYLE = """
:root { color-scheme: light dark; --ink: #1a1a1a; --faint: #d5d5d5; --paper: #fff; --quiet: #5c5c5c;
  --add: #d55e00; --adds: #0072b2; --both: #009e73; }
@media (prefers-color-scheme: dark) { :root { --ink: #e8e8e8; --faint: #444; --paper: #161616; --quiet: #a8a8a8;
  --add: #f0853a; --adds: #56a8e0; --both: #33bf93; } }
* { box-sizing: border-box; }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 66rem;
  margin: 1.5rem auto; padding: 0 1rem; }
h1 { font-size: 1.4rem; overflow-wrap: anywhere; } h2 { font-size: 1.1rem; margin-top: 2.2rem; }
p { max-width: 46rem; } figure p, .absent, .legend { color: var(--quiet); font-size: .85rem; margin: .3rem 0; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .55rem; text-align: right; white-space: nowrap; border-bottom: 1px solid var(--faint);
  vertical-align: top; }
th:first-child, td:first-child, .words { text-align: left; } tfoot td { font-weight: 600; }
th[scope=colgroup] { text-align: center; }
td.words { white-space: normal; min-width: 5.5rem; }
td:first-child, th:first-child { position: sticky; left: 0; background: var(--paper); }
th button { all: unset; cursor: pointer; font-weight: 600; } th button:focus-visible { outline: 2px solid var(--adds); }
th[aria-sort=ascending] button::after { content: " ▲"; } th[aria-sort=descending] button::after { content: " ▼"; }
dl { display: grid; grid-template-columns: minmax(7rem, 14rem) 1fr; gap: .2rem 1rem; }
dt { color: var(--quiet); overflow-wrap: anywhere; } dd { margin: 0; overflow-wrap: anywhere; }
.grid { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 20rem), 1fr)); gap: 1.2rem 2rem; }
figure { margin: 0; min-width: 0; } figcaption { font-weight: 600; font-size: .95rem; overflow-wrap: anywhere; }
svg { width: 100%; max-width: 30rem; height: auto; display: block; }
svg text { fill: var(--ink); font: 13px system-ui, sans-serif; }
.key { display: inline-block; margin-right: 1rem; }
.key i { display: inline-block; width: .8rem; height: .5rem; margin-right: .35rem; }
img { width: 100%; height: auto; display: block; background: var(--faint); }
@media (max-width: 30rem) { th, td { padding: .2rem .3rem; font-size: .82rem; }
  dl { grid-template-columns: 1fr; gap: 0; } dd { margin-bottom: .4rem; } }
"""

# A click on a heading sorts the body; totals are in the foot. What is no number comes last in either direction.
SCRIPT = """
for (const table of document.querySelectorAll("table.sortable")) {
  const headings = [...[...table.tHead.rows].at(-1).cells];
  headings.forEach((heading, column) => heading.querySelector("button").addEventListener("click", () => {
    const sign = heading.getAttribute("aria-sort") === "ascending" ? -1 : 1;
    headings.forEach((other) => other.setAttribute("aria-sort", "none"));
    heading.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
    const text = (row) => row.cells[column].textContent.trim();
    const number = (row) => (text(row) === "" ? NaN : Number(text(row)));
    const order = (a, b) => {
      const [x, y] = [number(a), number(b)];
      if (!isNaN(x) && !isNaN(y)) return sign * (x - y);
      if (isNaN(x) && isNaN(y)) return sign * text(a).localeCompare(text(b));
      return isNaN(x) - isNaN(y);
    };
    table.tBodies[0].append(...[...table.tBodies[0].rows].sort(order));
  }));
}
"""


def page(title: str, body: str) -> str:
    """body: HTML that is safe already. title: text."""
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style></head><body>\n{body}\n"
        f"<script>{SCRIPT}</script></body></html>\n"
    )
