"""Copies of this checkout, for tests that change one, and git."""

import shutil
import subprocess
from pathlib import Path

from helpers.lesson import ROOT


def git(folder: Path, *arguments: str) -> str:
    """Run git in a folder, whatever name its user has, and return what it prints."""
    who = ['-c', 'user.name=A', '-c', 'user.email=a@b.c', '-c', 'commit.gpgsign=false']
    done = subprocess.run(['git', *who, *arguments], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done
    return done.stdout


def copy_checkout(folder: Path) -> None:
    """Copy the files of this checkout that git knows or would add, with their changes."""
    names = git(ROOT, 'ls-files', '-z', '--cached', '--others', '--exclude-standard')
    for name in filter(None, names.split('\0')):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name, follow_symlinks=False)
