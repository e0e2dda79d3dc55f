"""Settings of the documentation site: `make docs` builds it in docs/_build/.

Pages are plain Markdown, which GitHub shows as it is. What only the site needs is in
`docs/site_pages/`: the contents, the programs that run, and the generated reference.
"""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import sainet  # noqa: E402

project = "sainet"
author = "The sainet contributors"
project_copyright = "The sainet contributors"
release = version = sainet.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "site_pages.extension",
]
source_suffix = {".md": "myst-nb"}
root_doc = "index"
exclude_patterns = ["_build", "site_pages", "templates"]
nitpicky = True
# Types of other packages and of internal modules: the site has no pages of theirs.
nitpick_ignore_regex = [("py:.*", r".*")]
suppress_warnings = ["config.cache"]

myst_enable_extensions = ["attrs_inline"]
myst_heading_anchors = 4
myst_links_external_new_tab = False

# Programs and commands of the tutorials run while the site is built.
nb_execution_mode = "cache"
nb_execution_cache_path = str(HERE / "_build" / "executed")
nb_execution_in_temp = True
nb_execution_timeout = 600  # s, for one cell, on a busy machine
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True

# Single backquotes in docstrings mark code, as in Markdown.
default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_attr_annotations = False  # shapes stand in the text
napoleon_use_ivar = True
python_use_unqualified_type_names = True
add_module_names = False
toc_object_entries = False

html_theme = "furo"
html_title = f"sainet {release}"
html_static_path = ["site_pages/static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "light_css_variables": {
        "color-brand-primary": "#00745f",
        "color-brand-content": "#00745f",
    },
    "dark_css_variables": {
        "color-brand-primary": "#35c7a8",
        "color-brand-content": "#35c7a8",
    },
}
