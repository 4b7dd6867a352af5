"""The set-up of a copy of this project, on a lock of two packages that lie in a folder."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from helpers.lesson import ROOT
from support.processes import put

LOCKS = Path('tools/locks')
BASE_PYTHON = Path(sys._base_executable)
HERE = f'{sys.version_info.major}.{sys.version_info.minor}'
COMMANDS = (
    *('cat', 'cksum', 'cp', 'df', 'dirname', 'env', 'fallocate', 'find', 'flock', 'getconf'),
    *('grep', 'head', 'id', 'mkdir', 'mktemp', 'mv', 'rm', 'sed', 'sh', 'sort', 'tr', 'uname'),
    'wc',
)
# What an environment of these locks has.
ONE = ['iniconfig', 'ros2-command', 'ros2-notebooks']
ALL = ['iniconfig', 'pluggy', 'ros2-command', 'ros2-notebooks']
NO_NETWORK = {'PIP_NO_INDEX': '0', 'PIP_INDEX_URL': 'http://127.0.0.1:9/', 'PIP_RETRIES': '0'}
NO_NETWORK |= {'UV_HTTP_RETRIES': '0', 'PIP_FIND_LINKS': '', 'UV_NO_CACHE': '1'}


def last_line(answer: subprocess.CompletedProcess) -> str:
    return answer.stderr.strip().rpartition('\n')[2]


class Checkout:
    """A copy of this project with a small lock, on a machine with nothing but some commands.

    Or of a handout of it, if `course` is an unpacked archive.
    """

    def __init__(self, folder: Path, wheels: Path | None = None, course: Path = ROOT) -> None:
        self.wheels, self.bin = wheels or folder / 'wheels', folder / 'bin'
        self.pythons = f'3.14 {HERE}'
        self.bin.mkdir()
        for command in COMMANDS:
            if where := shutil.which(command):
                put(self.bin, command, f'exec {where} "$@"')  # no link: a test may write here
        put(self.bin, 'python3', f'exec "{BASE_PYTHON}" "$@"')
        put(self.bin, 'python3.14', 'echo "pyenv: python3.14: command not found" >&2; exit 127')
        self.root = folder / 'élève one'
        self.root.mkdir()
        for name in ('tools', 'helpers', 'ros2'):
            shutil.copytree(course / name, self.root / name)
        for name in ('pyproject.toml', 'LICENSE'):
            shutil.copy(course / name, self.root)
        blocks = re.split(r'\n(?=[a-z])', (ROOT / LOCKS / 'requirements.lock').read_text())
        self.pins = {
            name: next(f'{block}\n' for block in blocks if block.startswith(f'{name}=='))
            for name in ('iniconfig', 'pluggy')
        }
        self.lock()

    def fetch(self) -> None:
        """Fetch the packages of the locks, as `make handout OFFLINE=yes` does."""
        for lock in ('requirements.lock', 'requirements-uv.lock'):
            command = [BASE_PYTHON, '-I', ROOT / 'tools/pip.py', 'download', '--quiet', '--no-deps']
            command += ['--require-hashes', '--requirement', self.root / LOCKS / lock]
            subprocess.run([*command, '--dest', self.wheels], check=True)

    def lock(self, *names: str, group: str = '') -> None:
        """Write a lock of these packages, or of all."""
        file = self.root / LOCKS / f'requirements{group and f"-{group}"}.lock'
        header = f'# Every wheel exists for Python {self.pythons}\n'
        file.write_text(header + ''.join(self.pins[name] for name in names or self.pins))

    def start(
        self, *arguments: str, user: int | None = None, **environment: str
    ) -> subprocess.Popen:
        """Start the set-up offline. As a user may have it: settings of pip only, none of uv."""
        kept = {k: v for k, v in os.environ.items() if not k.startswith(('PIP_', 'UV_'))}
        kept |= {'PIP_NO_INDEX': '1', 'PIP_FIND_LINKS': self.wheels.as_uri()}
        kept |= {'UV_CACHE_DIR': str(self.wheels / 'cache'), 'PIP_CONFIG_FILE': os.devnull}
        kept |= {'PATH': str(self.bin)} | environment
        return subprocess.Popen(
            [self.root / 'tools/set_up.sh', *arguments],
            env=kept,
            cwd='/',
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            user=user,
        )

    def set_up(
        self, *arguments: str, user: int | None = None, **environment: str
    ) -> subprocess.CompletedProcess:
        """Run the set-up to its end."""
        process = self.start(*arguments, user=user, **environment)
        out, err = process.communicate()
        return subprocess.CompletedProcess(process.args, process.returncode, out, err)

    def installed(self) -> list[str]:
        code = 'from importlib.metadata import distributions as d; print(*(i.name for i in d()))'
        command = [self.root / '.venv/bin/python', '-I', '-c', code]
        return sorted(subprocess.check_output(command, text=True).split())

    def stamp(self) -> str:
        stamp = self.root / '.venv/set_up.stamp'
        return f'{stamp.stat().st_mtime_ns} {stamp.read_text()}' if stamp.exists() else ''


@pytest.fixture(scope='session')
def wheels(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with what the small locks name, fetched once."""
    checkout = Checkout(tmp_path_factory.mktemp('wheels'))
    checkout.fetch()
    return checkout.wheels
