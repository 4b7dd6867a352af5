"""The faults, as their folders say them, and a robot that has one, in a workspace."""

from __future__ import annotations

import difflib
import re
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import yaml

from helpers.workspace import Workspace

HERE = Path(__file__).parent
HEALTHY = HERE / 'healthy'
NAME = 'courier'  # of the package in the folders; a robot has its own
FILE = 'fault.yaml'
GIVEN = 'given'  # a folder of the workspace: each package as it was
INSTALLED = 'installed'  # files that are built, and then replaced in src alone

# The kinds of faults that people meet, by the word with which one is guessed.
KINDS = {
    'qos': 'publisher and subscriber ask for a quality of service that does not match',
    'name': 'a topic, a node or a namespace is called otherwise on the two sides',
    'type': 'one topic, two types of messages',
    'publishers': 'two programs publish what only one may',
    'parameter': 'a parameter does not have the value that was meant for it',
    'lifecycle': 'a lifecycle node is not active',
    'queue': 'a queue is so deep that what comes out of it is old',
    'blocked': 'a callback never ends, so its node does nothing else',
    'clock': 'a stamp or a node uses another clock',
    'sign or unit': 'a sign is wrong, or a unit: degrees, millimetres',
    'nan': 'a number that is none, where nobody looks',
    'old build': 'what runs is not what is in src',
    'domain': 'a program is in another domain',
    'loop': 'a message comes back to where it was',
    'leftover': 'a program of yesterday still runs',
}


@dataclass(frozen=True)
class Mend:
    """A change of a robot: edits of its files, {file: {old: new}}, and commands in a terminal.

    Of a wrong mend, `says` tells what it does. It is known by the pattern `sees`, in the lines that
    were added or, if it has a `run`, in the commands; or by a text that no file has any more,
    `lacks`. With `ends` it is said only if the drive has ended so (see `Drive.how`).
    """

    edit: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    run: str = ''
    sees: str = ''
    lacks: str = ''
    says: str = ''
    ends: tuple[str, ...] = ()


@dataclass(frozen=True)
class Evidence:
    """Patterns of a command, and of a line that it prints only because of the fault."""

    command: str
    line: str


@dataclass(frozen=True)
class Fault:
    """What `fault.yaml` of a folder says.

    `kind` is one of `KINDS`; a guess of one in `also` is right, too. `broken` is a sentence, and
    `breaks` the edits of the healthy files. `fails` has how a drive may end (see `Drive.how`).
    `look` and `line` are a command and a line of its output that is evidence. `trouble` is what
    happens to its laser on the drive that judges a mend, and `keeps` has what must stay in a file.
    With `asks_route` its brake must stop it while the route is not active: one more drive.
    """

    name: str
    kind: str
    fails: tuple[str, ...]
    broken: str
    hint: str
    look: str
    line: str
    evidence: tuple[Evidence, ...]
    right: tuple[Mend, ...]
    wrong: tuple[Mend, ...]
    breaks: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    also: tuple[str, ...] = ()
    trouble: str = 'blind'
    asks_route: bool = False
    keeps: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    parent: Path = HERE  # of its folder

    @property
    def folder(self) -> Path:
        """Where its files are."""
        return self.parent / self.name

    @cached_property
    def files(self) -> dict[str, str]:
        """The files of the robot's package in src, by their paths."""
        files = _files(HEALTHY) | {
            path: text
            for path, text in _files(self.folder).items()
            if path != FILE and not path.startswith(f'{INSTALLED}/')
        }
        for path, edits in self.breaks.items():
            files[path] = edited(files[path], edits, f'{self.name}: {path}')
        return files

    @cached_property
    def installed(self) -> dict[str, str]:
        """Files that are built, and then replaced in src by those of `files`."""
        return _files(self.folder / INSTALLED)


def edited(text: str, edits: Mapping[str, str], where: str) -> str:
    """Return a text with each old part replaced by its new one.

    Raises ValueError if an old one is not there exactly once.
    """
    for old, new in edits.items():
        if text.count(old) != 1:
            raise ValueError(f'{where} has {old!r} {text.count(old)} times, not once.')
        text = text.replace(old, new)
    return text


def _files(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): path.read_text(encoding='utf-8')
        for path in sorted(folder.rglob('*'))
        if path.is_file() and '__pycache__' not in path.parts
    }


def _mend(told: dict) -> Mend:
    return Mend(**told | {'ends': tuple(told.get('ends', ()))})


def read(folder: Path) -> Fault:
    """Return the fault of a folder. Raises ValueError if its file does not say what it must."""
    try:
        told = yaml.safe_load((folder / FILE).read_text(encoding='utf-8'))
        mends = {key: tuple(map(_mend, told.pop(key))) for key in ('right', 'wrong')}
        evidence = tuple(Evidence(**pair) for pair in told.pop('evidence'))
        told |= {key: tuple(told.get(key, ())) for key in ('fails', 'also')}
        fault = Fault(name=folder.name, parent=folder.parent, evidence=evidence, **mends, **told)
    except (OSError, yaml.YAMLError, TypeError, KeyError, AttributeError) as error:
        raise ValueError(f'{folder.name}/{FILE}: {error}') from None
    if fault.kind not in KINDS:
        raise ValueError(f'{folder.name}/{FILE}: {fault.kind!r} is no kind of KINDS.')
    return fault


def mend_in_words(fault: Fault) -> list[str]:
    """Return what mends a robot, as lines: commands, or what goes and comes in its files."""
    mend = fault.right[0]
    lines = mend.run.splitlines()
    for path, edits in mend.edit.items():
        before = fault.files[path]
        changed = difflib.ndiff(before.splitlines(), edited(before, edits, path).splitlines())
        lines += [f'In {path}:', *(line for line in changed if line[0] in '-+')]
    return lines


FAULTS = {path.parent.name: read(path.parent) for path in sorted(HERE.glob(f'*/{FILE}'))}


class Case:
    """A robot of somebody else in a workspace: its package is `src/<name>`, and has a fault."""

    def __init__(self, workspace: Workspace, fault: Fault, name: str) -> None:
        self.workspace, self.fault, self.name = workspace, fault, name
        self.since = len(workspace.ran)

    def __repr__(self) -> str:
        return f'<the robot {self.name} in src/{self.name}>'  # and not what is wrong with it

    @property
    def folder(self) -> Path:
        """The folder of its package."""
        return self.workspace.file(f'src/{self.name}')

    def named(self, text: str) -> str:
        """Return a text of the fault with the robot's name in it."""
        return text.replace(NAME, self.name)

    @cached_property
    def given(self) -> dict[str, str]:
        """The files of its package as they were, by their paths."""
        return {self.named(path): self.named(text) for path, text in self.fault.files.items()}

    @property
    def files(self) -> dict[str, str]:
        """The files of its package as they are now. Those that are no text are left out."""
        found = {}
        for path in sorted(self.folder.rglob('*')):
            relative = path.relative_to(self.folder)
            if path.is_file() and not {'__pycache__', '.pytest_cache'} & {*relative.parts}:
                try:
                    found[relative.as_posix()] = path.read_text(encoding='utf-8')
                except (UnicodeDecodeError, OSError):
                    continue
        return found

    @property
    def is_changed(self) -> bool:
        """Whether a file is not as it was, or commands may have changed what runs."""
        return bool(self.files != self.given or self.fault.installed or self.wrong_mends())

    def wrong_mends(self) -> list[Mend]:
        """Return those of the tempting mends that are seen in what was changed."""
        files, added = self.files, []
        for path, text in files.items():
            lines = difflib.ndiff(self.given.get(path, '').splitlines(), text.splitlines())
            added += [line[2:] for line in lines if line.startswith('+ ')]
        ran = '\n'.join(commands for commands, _ in self.commands())
        return [
            mend
            for mend in self.fault.wrong
            if (mend.sees and re.search(mend.sees, ran if mend.run else '\n'.join(added)))
            or (mend.lacks and not any(mend.lacks in text for text in files.values()))
        ]

    def lost(self) -> str:
        """Return what must stay in a file and does not, or an empty text."""
        files = self.files
        for path, texts in self.fault.keeps.items():
            for text in texts:
                if text not in files.get(self.named(path), ''):
                    return f'{self.named(path)} must go on to have: {text}'
        return ''

    def commands(self) -> list[tuple[str, str]]:
        """Return what was run in terminals since the robot was taken, and what was printed."""
        return self.workspace.ran[self.since :]

    def write(self, files: Mapping[str, str]) -> None:
        """Write files of its package. The paths and texts are those of the fault."""
        for path, text in files.items():
            self.workspace.write(f'src/{self.name}/{self.named(path)}', self.named(text))

    def reset(self) -> None:
        """Write its package as it was, without a build."""
        for folder in ('src', 'build', 'install', GIVEN):
            shutil.rmtree(self.workspace.file(f'{folder}/{self.name}'), ignore_errors=True)
        self.write(self.fault.files)
        self.workspace.write(f'{GIVEN}/COLCON_IGNORE', '')
        for path, text in self.given.items():
            self.workspace.write(f'{GIVEN}/{self.name}/{path}', text)

    def mend(self, mend: Mend) -> None:
        """Change it. Raises ValueError if an old text is not there exactly once."""
        for path, edits in mend.edit.items():
            file = self.workspace.file(f'src/{self.name}/{self.named(path)}')
            text = file.read_text(encoding='utf-8') if file.exists() else ''
            named = {self.named(old): self.named(new) for old, new in edits.items()}
            text = edited(text, named, f'{self.fault.name}: {path}')
            file.write_text(text, encoding='utf-8')
        if mend.run:
            print(self.workspace.terminal(self.named(mend.run)))


def take(workspace: Workspace, fault: Fault, name: str, anew: bool = False) -> Case:
    """Put a robot with a fault into the workspace, and build its package.

    If it is there already, with the same fault, it stays as it was left, and is built only if no
    build is there, as after `make clean`. `anew` begins again.
    Raises ValueError for a name that no package can have, RuntimeError if it cannot be built.
    """
    return take_all(workspace, {name: fault}, anew)[name]


def take_all(
    workspace: Workspace, faults: Mapping[str, Fault], anew: bool = False
) -> dict[str, Case]:
    """Put robots into the workspace as `take` does, {name: fault}, and build them at once."""
    cases, unbuilt = {}, []
    for name, fault in faults.items():
        if not re.fullmatch('[a-z][a-z0-9_]*', name):
            raise ValueError(f'A robot has a name such as ada, not {name!r}.')
        case = cases[name] = Case(workspace, fault, name)
        before = _files(workspace.file(f'{GIVEN}/{name}'))
        if anew or not case.folder.exists() or before != case.given:
            case.reset()
            unbuilt.append(case)
        elif not workspace.file(f'install/{name}').exists():
            unbuilt.append(case)
    build(unbuilt)
    return cases


def build(cases: Sequence[Case]) -> None:
    """Build the packages of robots: where an old build is the fault, other files than in src.

    Raises RuntimeError if one of them cannot be built.
    """
    if not cases:
        return
    workspace = cases[0].workspace
    linked = [case for case in cases if not case.fault.installed]
    copied = [case for case in cases if case.fault.installed]
    old = {
        f'src/{case.name}/{case.named(path)}': case.named(text)
        for case in copied
        for path, text in case.fault.installed.items()
    }
    with workspace.replaced(old):
        for some, symlink_install in ((linked, True), (copied, False)):
            if some:
                names = [case.name for case in some]
                result = workspace.build(*names, symlink_install=symlink_install)
                if not result.ok:
                    raise RuntimeError(str(result))


def forget(workspace: Workspace, names: Iterable[str]) -> None:
    """Let robots begin again when they are taken the next time. Their packages stay until then."""
    for name in names:
        shutil.rmtree(workspace.file(f'{GIVEN}/{name}'), ignore_errors=True)
