"""A class that sees itself: `make class`. teaching.md says how to use it and what is kept.

helpers/checks/classroom.py says what students' computers ask of it, web.py what its page and the
deck do.
"""

from pathlib import Path

from jupyter_core.paths import jupyter_config_dir


def folder() -> Path:
    """Return the folder of the class that is open."""
    return Path(jupyter_config_dir(), 'class')


def page_file() -> Path:
    """Return the file that holds the address of the page as long as the class is open."""
    return folder() / 'page'
