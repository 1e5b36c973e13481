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

# Formulas are drawn by MathJax. With its `tex-svg.js` in this folder, a file that needs no other,
# they are drawn without a network; else the pages ask the network for it.
if mathjax := os.environ.get("PEGFIT_MATHJAX"):
    html_static_path = [mathjax]
    mathjax_path = "tex-svg.js"

html_theme = "furo"
html_title = f"pegfit {release}"
html_show_sourcelink = False
