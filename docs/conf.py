"""How the pages are built: `make docs`, then open out/docs/index.html."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # error_list

project = "conceptrack"
extensions = ["myst_parser", "error_list"]
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3  # PAGE.md#heading, as on a hosting site
html_theme = "furo"
html_title = "conceptrack"
html_copy_source = html_show_sourcelink = html_show_copyright = False
html_static_path = ["static"]
html_css_files = ["tables.css"]
pygments_style, pygments_dark_style = "default", "monokai"
suppress_warnings = ["config.cache"]
