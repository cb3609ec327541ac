"""Settings of the documentation: built by ``make docs``, with warnings as errors."""

import logging
import sys
from importlib import metadata
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))
logging.basicConfig(level=logging.WARNING)  # or furo's styles make every library chatter

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
    "sphinx_gallery.gen_gallery",
]
html_math_renderer = "mathml"
exclude_patterns = ["_extensions", "**/README.md", "**/GALLERY_HEADER.rst"]
source_suffix = {".md": "myst-nb", ".rst": "restructuredtext", ".ipynb": "myst-nb"}

myst_enable_extensions = ["dollarmath", "attrs_inline"]
myst_heading_anchors = 3
nb_execution_mode = "cache"
nb_execution_timeout = 300
nb_execution_in_temp = True
nb_execution_raise_on_error = True

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

_families = ("figures", "sources", "loadings")
sphinx_gallery_conf = {
    "examples_dirs": [f"gallery/{name}" for name in _families],
    "gallery_dirs": [f"gallery/generated/{name}" for name in _families],
    "filename_pattern": r"\.py$",
    "ignore_pattern": r"shared_\w+\.py$",
    "within_subsection_order": "FileNameSortKey",
    "image_scrapers": "gallery_figures.collect",
    "capture_repr": (),
    "notebook_extensions": set(),
    "download_all_examples": False,
    "write_computation_times": False,
    "show_signature": False,
    "abort_on_example_error": False,
}

html_theme = "furo"
html_title = f"granufab {release}"
html_copy_source = False
html_static_path = ["_static"]
html_css_files = ["print.css"]
suppress_warnings = ["ref.python", "config.cache"]
