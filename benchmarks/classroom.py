"""A class of 40: twelve kernels run lesson 02 many times, 28 seats tell 30 events a minute.

First all twelve are in the class. Then each kernel runs the lesson in turns in the class and out
of it, six and six at any time: so a cell is compared with itself, in the same kernel, on a machine
that is as busy.
"""

from __future__ import annotations

import csv
import json
import os
import tempfile
import threading
import time
import urllib.request
from collections import Counter
from concurrent.futures import ThreadPoolExecutor, wait
from itertools import count
from pathlib import Path

import nbformat
import psutil
from jupyter_client.manager import KernelManager
from support.classes import NAME, RunningClass, event, running_class

from helpers.progress import FILE_VARIABLE
from tools.class_server.lessons import Known
from tools.lessons.lesson import FOLDER, ROOT, read

KERNELS, SEATS, EVENTS, MINUTE_S = 12, 28, 30, 60.0
PAIRS = 4
PROBE_EVERY_S = 1.0


def tell(opened: RunningClass, question: str, seat: int, over: threading.Event) -> int:
    """Tell the guesses of a seat, evenly; return how many."""
    token = opened.join()
    told, next_at = 0, time.monotonic() + seat / SEATS * MINUTE_S / EVENTS
    while not over.wait(max(0, next_at - time.monotonic())):
        opened.tell(token, event(number=told, question=question, value=told))
        told, next_at = told + 1, next_at + MINUTE_S / EVENTS
    return told


def probe(opened: RunningClass, over: threading.Event) -> list[float]:
    """Raise and lower a hand again and again; return after how many seconds the page showed it."""
    token = opened.join(name='probe')
    shown: dict[bool, float] = {}
    seen = threading.Event()

    def read() -> None:
        with urllib.request.urlopen(f'{opened.page}live') as live:
            for line in live:
                if line.startswith(b'data: '):
                    hands = json.loads(line.removeprefix(b'data: '))['hands']
                    up = any(hand['name'] == 'probe' for hand in hands)
                    shown.setdefault(up, time.monotonic())
                    seen.set()

    threading.Thread(target=read, daemon=True).start()
    seen.wait(60)
    delays = []
    for number in count():
        if over.wait(PROBE_EVERY_S):
            return delays
        up = number % 2 == 0
        shown.pop(up, None)
        start = time.monotonic()
        opened.tell(token, event('hand', number, up=up))
        while up not in shown and not over.is_set():
            time.sleep(0.005)
        if up in shown:
            delays.append(shown[up] - start)
    return delays


def turns_of(kernel: int) -> list[bool]:
    """Return for each of its runs whether a kernel is in the class."""
    return [True, *((kernel + run) % 2 == 0 for run in range(2 * PAIRS))]


def run_lesson(folder: Path, join: str, turns: list[bool]) -> list[list[float]]:
    """Run lesson 02 in a kernel as JupyterLab does; return the seconds of the cells of each run."""
    [path] = FOLDER.glob(f'??_{NAME}.ipynb')
    cells = [cell for cell in nbformat.read(path, as_version=4).cells if 'outputs' in cell]
    files = [folder / kept / 'progress.txt' for kept in ('without', 'with')]
    for file in files:
        file.parent.mkdir(parents=True)
    session = {FILE_VARIABLE: str(files[True]), 'JPY_SESSION_NAME': str(path)}
    manager = KernelManager(transport='ipc', connection_file=str(folder / 'kernel.json'))
    manager.start_kernel(env=os.environ | session, cwd=str(FOLDER))
    client = manager.client()
    client.start_channels()
    client.wait_for_ready()

    def run(source: str, id_: str = 'join') -> float:
        content = {'code': source, 'silent': False, 'store_history': True, 'allow_stdin': False}
        message = client.session.msg('execute_request', content, metadata={'cellId': id_})
        start = time.monotonic()
        client.shell_channel.send(message)
        while (reply := client.get_shell_msg(timeout=600))['parent_header'].get(
            'msg_id'
        ) != message['header']['msg_id']:
            pass
        seconds = time.monotonic() - start
        if reply['content']['status'] != 'ok':
            raise RuntimeError(f'{id_}: {reply["content"]["evalue"]}')
        return seconds

    seconds = []
    try:
        run(join)
        for inside in turns:
            run(f'import os; os.environ[{FILE_VARIABLE!r}] = {str(files[inside])!r}')
            seconds.append([run(cell.source, cell.id) for cell in cells])
        time.sleep(1)  # what the last cell told is on its way
    finally:
        client.stop_channels()
        manager.shutdown_kernel()
    return seconds


def class_of_40() -> tuple[list[float], list[float], list[float], float]:
    """Return seconds: of cells in the class, the same out of it, and from an event to the page.

    The last value is what the class's server computes in a minute, also in seconds. Raises
    RuntimeError where an event was lost or came twice.
    """
    [path] = FOLDER.glob(f'??_{NAME}.ipynb')
    questions = list(Known(read(path.read_text(), path.name)).guesses)
    with tempfile.TemporaryDirectory() as temporary, ThreadPoolExecutor(64) as pool:
        folder = Path(temporary)
        with running_class(folder / 'class', '--root', str(ROOT)) as opened:
            over, start = threading.Event(), time.monotonic()
            delays = pool.submit(probe, opened, over)
            seats = [pool.submit(tell, opened, questions[0], n, over) for n in range(SEATS)]
            join = 'from helpers.classroom import *\n'
            join += f'join_class({opened.address!r}, {opened.code!r})'
            kernels = [
                pool.submit(run_lesson, folder / str(n), join, turns_of(n)) for n in range(KERNELS)
            ]
            wait(kernels)
            over.set()
            used = sum(psutil.Process(opened.process.pid).cpu_times()[:2])
            used *= MINUTE_S / (time.monotonic() - start)
            runs = [kernel.result() for kernel in kernels]
            wanted = [seat.result() for seat in seats]
            rows = list(csv.reader(opened.csv()))[1:]
    told = Counter(row[2] for row in rows if row[5] == 'guess')
    wanted += [len(questions) * sum(turns_of(n)) for n in range(KERNELS)]
    if sorted(told.values()) != sorted(wanted):
        raise RuntimeError(f'events were lost or came twice: {told.values()} of {wanted}')
    inside, without = [], []
    for n, run in enumerate(runs):
        for is_inside, seconds in list(zip(turns_of(n), run, strict=True))[1:]:
            (inside if is_inside else without).extend(seconds)
    return inside, without, delays.result(), used
