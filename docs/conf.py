"""The site of the documentation: `make docs` builds it from these pages, the package and the scenarios, offline."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))
sys.path.insert(0, str(Path(__file__).parents[1]))

from orbits import __version__

project = "orbits"
author = "The orbits developers"
copyright = "the orbits developers; MIT licence"
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "house_docstrings",
    "generated_pages",
    "registry_tables",
    "repository_links",
    "unicode_formulas",
]
nitpicky = True
smartquotes = False  # the quotation marks of commands are typed as they stand
exclude_patterns = ["_ext", "api"]  # docs/api/ is the reference in Markdown; the site has its own
highlight_language = "text"
pygments_style = "friendly"
pygments_dark_style = "native"

myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3

autodoc_typehints = "none"  # the docstrings say shapes and units, which types do not
autodoc_preserve_defaults = True
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
add_module_names = False
toc_object_entries_show_parents = "hide"
python_display_short_literal_types = True

html_theme = "furo"
html_title = f"orbits {__version__}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_theme_options = {"top_of_page_buttons": []}
