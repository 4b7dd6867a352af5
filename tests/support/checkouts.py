"""Copies of this checkout, for tests that change one."""

import shutil
import subprocess
from pathlib import Path

from tools.lessons.lesson import ROOT


def copy_checkout(folder: Path) -> None:
    """Copy the files of this checkout that git knows or would add, with their changes."""
    command = ['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard']
    done = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
    for name in filter(None, done.stdout.split('\0')):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name, follow_symlinks=False)
