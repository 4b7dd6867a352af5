"""Other texts in the files of a workspace for a while: the student's own always come back.

What a `with` block replaces is copied first, into a folder of the workspace. If the process is
killed within the block, the next look at that folder gives the files back: the guard of a check
looks when the check has ended, a kernel when it opens the workspace.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePath

from helpers.notebook import uninterrupted

KEPT = '.replaced'
THEIRS, OURS = 'theirs', 'ours'  # in it: what was there, and what stands there for a while


@contextlib.contextmanager
def replaced(workspace: Path, files: Mapping[str, str]) -> Iterator[None]:
    """Give files of a workspace other texts within a `with` block: {relative path: text}.

    A file that is new goes again, with the folders that were made for it. A file that somebody
    writes within the block stays as it is written. One such block is open at a time.
    """
    give_back(workspace)
    with uninterrupted():
        for name, text in files.items():  # all is kept before anything changes
            _keep(workspace, PurePath(name), text)
        for name in files:
            (workspace / name).parent.mkdir(parents=True, exist_ok=True)
            _put(workspace, OURS, name)
    try:
        yield
    finally:
        give_back(workspace)


def give_back(workspace: Path) -> None:
    """Give the files of a workspace back that a block has replaced, if it did not end."""
    kept = workspace / KEPT
    with uninterrupted():
        ours = [file for file in (kept / OURS).rglob('*') if file.is_file()]
        for text, name in [(file.read_bytes(), file.relative_to(kept / OURS)) for file in ours]:
            file = workspace / name
            if not file.is_file() or file.read_bytes() != text:
                continue  # it was not replaced yet, or somebody has written it since
            if (kept / THEIRS / name).is_file():
                _put(workspace, THEIRS, name)
            else:
                file.unlink()
                for folder in name.parents:
                    if not (kept / THEIRS / folder).is_dir():
                        shutil.rmtree(workspace / folder)
        shutil.rmtree(kept, ignore_errors=True)


def _keep(workspace: Path, name: PurePath, text: str) -> None:
    """Copy a file with the names of the folders above it, then write the text that replaces it.

    If there is such a text, the copy is whole.
    """
    ours, theirs = (workspace / KEPT / side / name for side in (OURS, THEIRS))
    ours.parent.mkdir(parents=True, exist_ok=True)
    for folder in name.parents:
        if (workspace / folder).is_dir():
            (workspace / KEPT / THEIRS / folder).mkdir(parents=True, exist_ok=True)
    if (workspace / name).is_file():
        shutil.copy(workspace / name, theirs)
    ours.write_text(text, encoding='utf-8')


def _put(workspace: Path, side: str, name: str | PurePath) -> None:
    """Replace a file by one that is kept, whole. Its time is new, so that `make` sees a change."""
    whole = workspace / KEPT / 'whole'
    shutil.copy(workspace / KEPT / side / name, whole)
    os.replace(whole, workspace / name)
