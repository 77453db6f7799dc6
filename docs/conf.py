"""How the documentation is built: ``make docs``."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))

project = "botohe_moo"
author = "The botohe_moo developers"
project_copyright = author
version = release = version_of("botohe-moo")

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "myst_nb",  # guides as myst_parser reads them, and notebooks
    # Those of _extensions:
    "command_line",
    "mathml",
    "public_names",
]
exclude_patterns = ["_build", "examples"]
templates_path = ["_templates"]
highlight_language = "none"  # what is printed, and what is typed at a shell

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

nb_execution_mode = "off"  # notebooks are shown as they are committed; tests run them

autosummary_generate = True
autodoc_typehints = "none"  # public_names puts them into the lists of parameters
autodoc_member_order = "bysource"
# No network, so that no references to other packages' documentation: pymoo's bases, and what
# functions return that is not this package's own.
nitpick_ignore_regex = [
    ("py:class", r"pymoo\..*"),
    ("py:class", r"(Algorithm|Population|Result)"),  # pymoo's, too
    ("py:class", r"(ndarray|pd\.DataFrame|Axes|Path)"),
    ("py:class", r"pytest\.MarkDecorator"),
    ("py:class", r"(Run|Limits|World)"),  # what a Study lists, and what kernels take; not exported
]
numpydoc_show_class_members = False
numpydoc_attributes_as_param_list = True

smartquotes = False  # --robots is an option, and no dash

html_theme = "pydata_sphinx_theme"
html_title = "botohe_moo"
html_math_renderer = "mathml"
html_sidebars = {"**": ["contents"]}
html_static_path = ["_static"]
html_css_files = ["botohe.css"]
html_theme_options = {
    "navbar_center": [],  # the contents are beside each page
    "footer_start": ["copyright"],
    "footer_end": [],
    "navigation_with_keys": False,
}
html_show_sourcelink = False
html_copy_source = False
