"""Sphinx configuration: MyST Markdown with the furo theme."""

from __future__ import annotations

from pathlib import Path

import navfuse
from navfuse.config import DeadReckoningProject, KeyHelp, help_keys

project = "navfuse"
author = "navfuse developers"
copyright = "2026, navfuse developers"
release = version = navfuse.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinx.ext.napoleon"]
myst_enable_extensions = ["amsmath", "deflist", "dollarmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build", "_generated"]
nitpicky = True
nitpick_ignore_regex = [("py:.*", ".*")]  # docstrings name shapes, units and internals, which are no links
default_role = "code"

autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

html_theme = "furo"
html_title = f"navfuse {release}"


def _dead_reckoning_keys() -> str:
    """The keys of ``[dead_reckoning]``; the other tables of such a project are those of every project."""
    return _project_file_keys([e for e in help_keys(DeadReckoningProject) if e.key.startswith("dead_reckoning.")])


def _project_file_keys(entries: list[KeyHelp] | None = None) -> str:
    """Every key of the project file with its meaning, made from the model that checks it."""
    lines, section = [], ""
    for entry in help_keys() if entries is None else entries:
        if entry.key.split(".")[0] != section:
            section = entry.key.split(".")[0]
            lines += [f"### `[{section}]`", ""]
        unit = f" [{entry.unit}]" if entry.unit else ""
        default = (
            "; required" if entry.default == "required" else f"; default `{entry.default}`" if entry.default else ""
        )
        lines += [f"`{entry.key}`{unit}", f": {entry.type}{default}.", f"  {entry.description}", ""]
    return "\n".join(lines)


def setup(app) -> None:
    folder = Path(app.confdir) / "_generated"
    folder.mkdir(exist_ok=True)
    (folder / "keys.md").write_text(_project_file_keys(), encoding="utf-8")
    (folder / "dead_reckoning_keys.md").write_text(_dead_reckoning_keys(), encoding="utf-8")
