"""Configuration of the site, which `python -m sphinx -W docs docs/_build` builds offline."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import ncrs

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS / "_ext"))

os.environ.setdefault("NCRS_QUIET", "1")  # notices would differ from one computer to the next

project = "NCRS"
author = "The NCRS developers"
copyright = author
release = version = ncrs.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "mathml",
    "plain_attributes",
    "generated",
]
exclude_patterns = ["_build", "_ext", "_static", "archives", "jupyter_execute"]

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

nb_execution_mode = "cache"  # pages that have not changed are not run again; a new folder has none
nb_execution_cache_path = str(DOCS / "_build" / ".jupyter_cache")
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 600  # seconds for a cell, which takes a tenth of it on an idle computer
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_type_aliases = {"BodyGrid": "BodyGrid", "States": "States", "Picture": "Picture"}
autodoc_preserve_defaults = True
napoleon_numpy_docstring = False
napoleon_use_rtype = False
add_module_names = False
python_use_unqualified_type_names = True

html_math_renderer = "mathml"
html_theme = "furo"
html_title = "NCRS"
html_static_path = ["_static"]
html_css_files = ["ncrs.css"]

html_show_sourcelink = False
html_copy_source = False
copybutton_exclude = ".linenos, .gp, .go"
