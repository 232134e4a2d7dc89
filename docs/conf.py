"""How Sphinx builds the site: ``scripts/docs``."""

import os
import re
import sys
from pathlib import Path

import myst_nb.core.render
from nbformat import NotebookNode
from sphinx.application import Sphinx

import tensegra

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

# What a tutorial runs in a shell is the tensegra of this environment, and prints as into a file.
os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
os.environ |= {"COLUMNS": "100", "TERM": "dumb", "NO_COLOR": "1"}
if Path(tensegra.__file__).is_relative_to(HERE.parent):
    # The tutorials' kernels shall see the same checkout as this process.
    os.environ["PYTHONPATH"] = str(HERE.parent / "src")

project = "tensegra"
author = "The tensegra developers"
copyright = author  # noqa: A001 - Sphinx's own name for it
version = release = tensegra.__version__
language = "en"

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",  # so that formulas need nothing from outside
    "sphinx_design",
]
exclude_patterns = ["_build", "generate", "schemas", "images", "templates", "**/.jupyter_cache"]
templates_path = ["templates"]
nitpick_ignore: list[tuple[str, str]] = []

# -- pages -------------------------------------------------------------------------------------------
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist", "attrs_inline"]
myst_heading_anchors = 4

# -- tutorials ---------------------------------------------------------------------------------------
# "cache" runs a page again where its code has changed; `scripts/docs` begins without a cache.
nb_execution_mode = os.environ.get("TENSEGRA_DOCS_EXECUTION", "cache")
nb_execution_raise_on_error = True
nb_execution_in_temp = True
nb_execution_timeout = 600
nb_merge_streams = True

# -- docstrings --------------------------------------------------------------------------------------
autosummary_generate = True
autodoc_typehints = "none"  # they stand in the text
autodoc_preserve_defaults = True
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

# -- looks -------------------------------------------------------------------------------------------
html_theme = "pydata_sphinx_theme"
html_title = "tensegra"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_show_search_summary = False  # from a file a browser may not fetch the pages for it
html_theme_options = {
    "navigation_with_keys": False,
    "show_toc_level": 2,
    "header_links_before_dropdown": 8,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "tango",
}
html_sidebars = {"index": [], "why": [], "benchmarks": []}


def joined(outputs: list[NotebookNode]) -> list[NotebookNode]:
    """Return the outputs of a cell with each stream in one piece, and without a terminal's codes.

    What commands print comes in pieces of a hundred letters, which MyST-NB would join by line ends.
    """
    made: list[NotebookNode] = []
    streams: dict[str, NotebookNode] = {}
    for output in outputs:
        if output["output_type"] != "stream":
            made.append(output)
        elif output["name"] in streams:
            streams[output["name"]]["text"] += output["text"]
        else:
            streams[output["name"]] = output
            made.append(output)
    for output in streams.values():
        output["text"] = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", output["text"])
    # What goes to stderr, such as progress, comes before the result.
    return sorted(made, key=lambda output: output.get("name") != "stderr")


myst_nb.core.render.coalesce_streams = joined


def setup(app: Sphinx) -> None:
    """Make the generated pages before any page is read."""
    from generate import write_all

    app.connect("builder-inited", lambda _app: write_all(HERE / "generated"))
