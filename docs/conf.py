"""Configuration of the documentation: ``make docs`` builds it into build/docs/html, without access to the network."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

from tmc_vem import __version__

project = "tmc-vem"
author = "The tmc-vem authors"
copyright = "The tmc-vem authors, MIT licence"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "mathml", "gallery",
              "reference"]  # fmt: skip
exclude_patterns = ["_ext"]
root_doc = "index"

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "substitution"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "show-inheritance": True}
autodoc_preserve_defaults = True
napoleon_use_ivar = True
napoleon_attr_annotations = False
python_use_unqualified_type_names = True

# Every reference must resolve, but for those to types of other projects, which are not indexed here.
nitpicky = True
nitpick_ignore_regex = [("py:.*", r"(?!tmc_vem|codegen).*"), ("py:class", r".*\.(Function|T)")]

html_theme = "furo"
html_title = f"tmc-vem {version}"
html_static_path = []
html_copy_source = False
html_show_sphinx = False

# Links to other sites are checked by 'make linkcheck' only: a build must not need the network. A site that is silent is
# asked twice and then reported; one that asks for patience gets half a minute.
linkcheck_timeout = 10
linkcheck_retries = 2
linkcheck_rate_limit_timeout = 30
linkcheck_report_timeouts_as_broken = True
linkcheck_anchors = False
linkcheck_ignore = [
    r"https://doi\.org/10\.1016/.*",  # leads to a publisher that answers programs with 403
]

# Attributes of one name in several classes: a mention of it outside of them links to none.
suppress_warnings = ["ref.python"]
