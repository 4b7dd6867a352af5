"""The command: which programs, which troubles, how many at once, and what does not stand."""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import yaml

from helpers.lesson import ROOT, chosen
from ordeal.network import possible
from ordeal.programs import Prepared, declared
from ordeal.sentences import write_sentences
from ordeal.troubles import NOTHING, Trouble, troubles

KNOWN = Path(__file__).with_name('known.yaml')
FOLDER = ROOT / 'scratch' / 'ordeal'
TRIAL_S = 240.0  # longer than the longest trial on a busy machine


@dataclass
class Job:
    """A trial that is to be done, or was: `result` is what `Trial.run` returned."""

    program: str
    base: str
    trouble: Trouble
    seed: int
    result: dict[str, Any] | None = None

    @property
    def name(self) -> str:
        return f'{self.program}, {self.base}, {self.trouble.name}'

    @property
    def folder(self) -> Path:
        return FOLDER / ''.join(c if c.isalnum() or c in '-_.' else '_' for c in self.name)

    @property
    def again(self) -> str:
        """The command that repeats it."""
        return (
            f'make ordeal TASK={self.program} SEED={self.seed} BASE={self.base} '
            f'TROUBLE="{self.trouble.name}"'
        )

    @property
    def began(self) -> bool:
        return bool(self.result) and 'did_not_begin' not in self.result

    @property
    def stood(self) -> bool:
        return self.began and not self.result['broken']


def start(program: Prepared, job: Job) -> subprocess.Popen:
    """Start a trial in a process of its own."""
    shutil.rmtree(job.folder, ignore_errors=True)
    job.folder.mkdir(parents=True)
    told = {
        'declared': program.on(job.base),
        'commands': program.commands(),
        'folder': str(program.folder),
        'environment': program.environment,
        'clock': str(program.clock),
        'base': job.base,
        'trouble': asdict(job.trouble),
    }
    (job.folder / 'trial.json').write_text(json.dumps(told), encoding='utf-8')
    before = filter(None, [program.environment.get('PYTHONPATH')])
    path = os.pathsep.join([str(ROOT / 'tests'), str(ROOT), *before])
    with (job.folder / 'trial.log').open('w') as said:
        return subprocess.Popen(
            [sys.executable, '-m', 'ordeal.trial', str(job.folder)],
            env=program.environment | {'PYTHONPATH': path},
            stdout=said,
            stderr=subprocess.STDOUT,
        )


def done(program: Prepared, jobs: Iterable[Job], at_once: int) -> Iterator[Job]:
    """Do the trials, some at once, and yield each when it is done."""
    waiting, running = [*jobs], []
    try:
        while waiting or running:
            while waiting and len(running) < at_once:
                job = waiting.pop(0)
                running.append((job, start(program, job), time.monotonic()))
            for entry in running[:]:
                job, process, since = entry
                if process.poll() is None and time.monotonic() - since < TRIAL_S:
                    continue
                process.terminate()
                process.wait()
                running.remove(entry)
                job.result = result_of(job)
                yield job
            time.sleep(0.05)
    finally:
        for _, process, _ in running:
            process.terminate()
            process.wait()


def result_of(job: Job) -> dict[str, Any]:
    file = job.folder / 'result.json'
    if file.exists():
        return json.loads(file.read_text(encoding='utf-8'))
    said = (job.folder / 'trial.log').read_text(encoding='utf-8', errors='replace')
    return {'broken': '', 'did_not_begin': 'the trial itself failed', 'said': said[-1500:]}


def meet(
    program: Prepared, base: str, found: Sequence[Trouble], seed: int, at_once: int
) -> Iterator[Job]:
    """Let a program meet troubles on a base, and yield each trial.

    What does not stand is tried once more, alone: the machine may have been busy.
    """
    jobs = [Job(program.name, base, trouble, seed) for trouble in found]
    for job in done(program, jobs, at_once):
        if not job.stood:
            [job] = done(program, [Job(program.name, base, job.trouble, seed)], 1)
        yield job


def of_program(program: Prepared, options: argparse.Namespace) -> Iterator[Job]:
    """Yield the trials of a program that the options choose."""
    for base in program.declared['bases']:
        if options.base not in ('', base):
            continue
        [plain] = meet(program, base, [NOTHING], options.seed, 1)
        yield plain
        if not plain.stood:
            continue
        found = troubles(program.on(base), plain.result['seen'], program.name, base, options.seed)
        found = [one for one in found if options.trouble.lower() in one.name.lower()]
        if reason := possible():
            print(f'The network is not cut here: {reason}', flush=True)
            found = [one for one in found if one.of != 'network']
        if options.count is not None:
            drawn = random.Random(f'{options.seed} {program.name} {base}')
            found = drawn.sample(found, min(options.count, len(found)))
        yield from meet(program, base, found, options.seed, options.jobs)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the ordeal, and return 1 if what stands is not what known.yaml says."""
    options = parser().parse_args(arguments)
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # in the background of a shell
        signal.signal(signal.SIGINT, signal.default_int_handler)
    results: list[Job] = []
    for name in chosen_programs(options):
        program = Prepared(name)
        try:
            for job in of_program(program, options):
                results.append(job)
                say(job)
        finally:
            program.close()
        if options.write:
            write_known(results)
            write_sentences(known())
    began = [job for job in results if job.began]
    stood = [job for job in began if job.stood]
    print(
        f'{len({job.program for job in results})} programs, {len(results)} trials: '
        f'{len(stood)} stood, {len(began) - len(stood)} did not, '
        f'{len(results) - len(began)} did not begin; seed {options.seed}.'
    )
    if options.write:
        return int(len(began) < len(results))
    differs = differences(results)
    print(*differs, sep='\n')
    return int(bool(differs))


def say(job: Job) -> None:
    """Print what a trial has shown; of a failure also its command and its replay."""
    if not job.began:
        print(f'?  {job.name}: {job.result["did_not_begin"]}\n{job.result["said"]}', flush=True)
    elif job.stood:
        print(f'+  {job.name}', flush=True)
    else:
        print(f'-  {job.name}: it {job.result["broken"]}', flush=True)
        print(f'   {job.again}\n   replay: {job.folder / "replay.html"}', flush=True)


# --- What is known not to stand


def known() -> dict[str, dict[str, list[str]]]:
    """Return what does not stand: by program and trouble, the bases."""
    if not KNOWN.exists():
        return {}
    return yaml.safe_load(KNOWN.read_text(encoding='utf-8')) or {}


def write_known(results: Iterable[Job]) -> None:
    """Write what does not stand. What was not tried stays as it is written."""
    found = known()
    for job in results:
        if job.began:
            bases = {*found.setdefault(job.program, {}).get(job.trouble.name, [])}
            bases = bases - {job.base} if job.stood else bases | {job.base}
            found[job.program][job.trouble.name] = sorted(bases)
    kept = {}
    for name in declared():
        if name in found:
            kept[name] = {what: bases for what, bases in sorted(found[name].items()) if bases}
    head = '# What does not stand, and on which bases. Written by `make ordeal WRITE=yes`.\n'
    text = yaml.safe_dump(kept, sort_keys=False, width=100, default_flow_style=None)
    KNOWN.write_text(head + text, encoding='utf-8')


def differences(results: Iterable[Job]) -> list[str]:
    """Return a sentence for each trial that differs from known.yaml, or did not begin."""
    listed, found = known(), []
    for job in results:
        is_listed = job.base in listed.get(job.program, {}).get(job.trouble.name, [])
        if not job.began:
            found.append(f'{job.name}: {job.result["did_not_begin"]}. {job.again}')
        elif job.stood and is_listed:
            found.append(f'{job.name}: it stands now, and {KNOWN.name} says that it does not.')
        elif not job.stood and not is_listed:
            found.append(f'{job.name}: it {job.result["broken"]}. {job.again}')
    return found


# --- Options


def chosen_programs(options: argparse.Namespace) -> list[str]:
    lessons = {path.stem[3:] for path in chosen(options.lesson)}
    names = [name for name, say in declared().items() if say['lesson'] in lessons]
    if options.task:
        names = [name for name in names if name in options.task.split()]
    if not names:
        sys.exit(f'There is no such program. There are: {", ".join(declared())}.')
    return names


def parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='make ordeal', description=__doc__)
    parser.add_argument('--lesson', default='', help='number or name; all, if nothing is named')
    parser.add_argument('--task', default='', help='names of programs in programs.yaml')
    parser.add_argument('--base', default='', help='kind, untimed or turtlebot3')
    parser.add_argument('--trouble', default='', help='only those with these words in their name')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--count', type=int, help='so many troubles of each program and base')
    parser.add_argument('--jobs', type=int, default=2)
    parser.add_argument('--write', action='store_true', help='write known.yaml')
    return parser
