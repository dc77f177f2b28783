"""Charts of a report: SVG in the page's own colours, one file a chart. Widths suit a phone, where a report may be read:
at 360 CSS pixels no letter is smaller than 11."""
