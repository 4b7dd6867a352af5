"""A class that sees itself: `make class`. teaching.md says how to use it and what is kept."""

from pathlib import Path

from jupyter_core.paths import jupyter_config_dir


def folder() -> Path:
    """Return the folder of the class that is open."""
    return Path(jupyter_config_dir(), 'class')


def page_file() -> Path:
    """Return the file in which the server of `make present` finds the address of the page."""
    return folder() / 'page'
