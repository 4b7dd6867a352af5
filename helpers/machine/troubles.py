"""What a disk refuses, as one sentence that says what to do.

tools/troubles.sh has the sentences of the set-up.
"""

import errno
import os
from pathlib import Path

from helpers.machine.folders import ROOT

FULL = errno.ENOSPC, errno.EDQUOT
REFUSED = errno.EACCES, errno.EPERM, errno.EROFS


def sentence_about(error: OSError, root: Path = ROOT) -> str:
    """Return in one sentence what to do about an error, of a file that is usually below `root`."""
    path = Path(error.filename2 or error.filename or root)
    if error.errno in FULL:
        folder = path if path.is_dir() else path.parent
        return f'There is no room left in {folder}. Make room, then try again.'
    if error.errno not in REFUSED or not path.is_relative_to(root):
        return f'{path}: {error.strerror or error}.'
    place = next((one for one in (path, *path.parents) if _is_of_another(one)), None)
    if place and place.is_relative_to(root) and os.access(root, os.W_OK):
        return (
            f'{place} is another user\'s: take it with `sudo chown -R "$(id -u)" '
            f'"{root}"`, then try again.'
        )
    return f'The folder {root} cannot be written: copy it to one of your own, then try again.'


def _is_of_another(path: Path) -> bool:
    # Not Path.exists: in a folder that is closed it raises.
    return os.path.exists(path) and path.stat().st_uid != os.geteuid()
