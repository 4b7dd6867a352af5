"""Editions of the course as students get them."""

import tarfile
from pathlib import Path

from classroom import update


def archive_of(folder: Path) -> Path:
    """Pack a course as `make handout` does. Return its archive, beside it."""
    with tarfile.open(folder.with_suffix('.tar.gz'), 'w:gz') as archive:
        archive.add(folder, 'course')
        archive.add(folder, f'course/{update.BASE}')
    return folder.with_suffix('.tar.gz')
