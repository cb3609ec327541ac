"""Settings of the documentation: built by ``make docs``, with warnings as errors."""

import sys
from importlib import metadata
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))

project = "granufab"
author = "The granufab authors"
copyright = "The granufab authors"
release = metadata.version("granufab")

extensions = [
    "mathml",
    "plain_bars",
    "reference",
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
]
html_math_renderer = "mathml"
exclude_patterns = ["_extensions", "**/README.md"]
source_suffix = {".md": "myst-nb", ".rst": "restructuredtext", ".ipynb": "myst-nb"}

myst_enable_extensions = ["dollarmath", "attrs_inline"]
myst_heading_anchors = 3
nb_execution_mode = "cache"
nb_execution_timeout = 300
nb_execution_in_temp = True
nb_execution_raise_on_error = True

autodoc_typehints = "signature"
autodoc_type_aliases = {"Array": "Array", "IntArray": "IntArray", "ArrayLike": "ArrayLike"}
autodoc_member_order = "bysource"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

html_theme = "furo"
html_title = f"granufab {release}"
html_copy_source = False
html_static_path = ["_static"]
html_css_files = ["print.css"]
suppress_warnings = ["ref.python", "config.cache"]
