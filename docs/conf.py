"""The site: `just site` builds it, warnings are errors. The pages are those that GitHub shows."""

import os
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent

project = "pegfit"
author = "the pegfit authors"
copyright = author
with open(HERE.parent / "Cargo.toml", "rb") as manifest:
    release = tomllib.load(manifest)["workspace"]["package"]["version"]

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinxcontrib.mermaid",
]
exclude_patterns = ["requirements.txt", "_build"]
# What is missing is a mistake: a link without a page, a name without an object.
nitpicky = False

# GitHub's anchors of headings, its fences of formulas and drawings.
myst_heading_anchors = 4
myst_enable_extensions = ["amsmath", "deflist", "dollarmath"]
myst_fence_as_directive = ["math", "mermaid"]

# Tutorials run while the site is built, each from nothing; a cell that raises ends the build.
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_execution_in_temp = True
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
napoleon_use_ivar = True

# Formulas are drawn by MathJax and drawings by Mermaid, in the reader's browser. With both in this
# folder the pages need no network; else they ask it for them.
if scripts := os.environ.get("PEGFIT_SCRIPTS"):
    html_static_path = [scripts]
    mathjax_path = "tex-svg.js"
    mermaid_use_local = "mermaid.esm.min.mjs"

# With the page that needs no program (`just wasm`) in this folder, the first page of the site holds
# it in place of its picture, and `tests/site/run` puts it beside the pages.
PICTURE = "](figures/play.png)"
FRAME = """```{raw} html
<iframe src="play-here/index.html" title="pegfit play" loading="lazy"
  style="width: 100%; height: 640px; border: 1px solid #d5dde6; border-radius: 8px"></iframe>
```"""


def hold_page(_app: object, name: str, source: list[str]) -> None:
    """Puts the page in place of the first page's picture of it."""
    if name == "index":
        (line,) = [line for line in source[0].splitlines() if line.endswith(PICTURE)]
        source[0] = source[0].replace(line, FRAME)


def setup(app: object) -> None:
    """Called by Sphinx."""
    if os.environ.get("PEGFIT_WASM"):
        app.connect("source-read", hold_page)


html_theme = "furo"
html_title = f"pegfit {release}"
html_show_sourcelink = False
