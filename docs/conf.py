"""The site: `just site` builds it, warnings are errors. The pages are those that GitHub shows."""

import os
import subprocess
import time
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
    "sphinx_copybutton",
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
autodoc_preserve_defaults = True
# Half a gigabyte, of which the page needs a name.
autodoc_mock_imports = ["rerun"]
# Names as the source has them, where what they stand for is long.
autodoc_type_aliases = {
    name: name
    for name in (
        "ArrayLike",
        "File",
        "Float",
        "MeshLike",
        "Path",
        "PosesLike",
        "Progress",
        "RotationLike",
        "Window",
    )
}
# A word between single backquotes is code, as it is in the sources.
default_role = "code"
add_module_names = False
# A parameter on each line where one line would not do.
python_maximum_signature_line_length = 78
python_trailing_comma_in_multi_line_signatures = False
napoleon_use_ivar = True

# The prompts of a session are no part of what is copied.
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
# Nor is what a cell of a tutorial prints.
copybutton_selector = "div:not(.output) > div.highlight pre"

html_static_path = ["site"]
html_css_files = ["site.css"]

# Formulas are drawn by MathJax and drawings by Mermaid, in the reader's browser. With both in this
# folder the pages need no network; else they ask it for them.
if scripts := os.environ.get("PEGFIT_SCRIPTS"):
    html_static_path.append(scripts)
    mathjax_path = "tex-svg.js"
    mermaid_use_local = "mermaid.esm.min.mjs"

# Of letters that most fonts have.
mermaid_fullscreen_button = "⤢"
# Furo's dark style underlines the names of modules as if they were links.
pygments_dark_style = "github-dark"

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


def _date() -> str:
    """Day of the last change, or of the build where there is no history."""
    words = ["git", "log", "-1", "--format=%cs"]
    try:
        done = subprocess.run(words, cwd=HERE, capture_output=True, text=True)
    except OSError:
        return time.strftime("%Y-%m-%d")
    return done.stdout.strip() or time.strftime("%Y-%m-%d")


html_last_updated_fmt = _date()
html_theme_options = {
    "source_repository": "https://github.com/pegfit/pegfit/",
    "source_branch": "main",
    "source_directory": "docs/",
    "footer_icons": [
        {
            "name": "Repository",
            "url": "https://github.com/pegfit/pegfit",
            "html": "Repository",
            "class": "",
        }
    ],
}
