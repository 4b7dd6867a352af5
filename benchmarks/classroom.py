"""A class of 40: twelve kernels run lesson 02, and 28 seats tell 30 events each in a minute."""

from __future__ import annotations

import csv
import json
import os
import tempfile
import threading
import time
import urllib.request
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import nbformat
from jupyter_client.manager import KernelManager
from support.classes import NAME, RunningClass, event, running_class

from helpers.progress import FILE_VARIABLE
from tools.class_server.lessons import Known
from tools.lessons.lesson import FOLDER, ROOT, read

KERNELS, SEATS, EVENTS, MINUTE_S = 12, 28, 30, 60.0
PROBE_EVERY_S = 1.0


def tell_for_a_minute(opened: RunningClass, question: str, seat: int) -> None:
    """Tell the guesses of a seat, evenly over a minute."""
    token = opened.join()
    start = time.monotonic()
    for number in range(EVENTS):
        time.sleep(max(0, start + (number + seat / SEATS) * MINUTE_S / EVENTS - time.monotonic()))
        opened.tell(token, event(number=number, question=question, value=number))


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
    for number in range(10**6):
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


def run_lesson(folder: Path, join: str) -> list[float]:
    """Run lesson 02 in a kernel as JupyterLab does; return the seconds of each cell."""
    [path] = FOLDER.glob(f'??_{NAME}.ipynb')
    cells = nbformat.read(path, as_version=4).cells
    folder.mkdir()
    session = {FILE_VARIABLE: str(folder / 'progress.txt'), 'JPY_SESSION_NAME': str(path)}
    manager = KernelManager(transport='ipc', connection_file=str(folder / 'kernel.json'))
    manager.start_kernel(env=os.environ | session, cwd=str(FOLDER))
    client = manager.client()
    client.start_channels()
    client.wait_for_ready()
    seconds = []
    try:
        for id_, source in [('join', join), *((c.id, c.source) for c in cells if 'outputs' in c)]:
            content = {'code': source, 'silent': False, 'store_history': True, 'allow_stdin': False}
            message = client.session.msg('execute_request', content, metadata={'cellId': id_})
            start = time.monotonic()
            client.shell_channel.send(message)
            while (reply := client.get_shell_msg(timeout=600))['parent_header'].get(
                'msg_id'
            ) != message['header']['msg_id']:
                pass
            seconds.append(time.monotonic() - start)
            if reply['content']['status'] != 'ok':
                raise RuntimeError(f'{id_}: {reply["content"]["evalue"]}')
        time.sleep(1)  # what the last cell told is on its way
    finally:
        client.stop_channels()
        manager.shutdown_kernel()
    return seconds[1:]


def run_lessons(folder: Path, join: str) -> list[float]:
    """Run the lesson in all kernels at once; return the seconds of all cells."""
    with ThreadPoolExecutor(KERNELS) as kernels:
        runs = kernels.map(lambda n: run_lesson(folder / str(n), join), range(KERNELS))
        return [seconds for run in runs for seconds in run]


def class_of_40() -> tuple[list[float], list[float], list[float]]:
    """Return the seconds of the cells in a class, without one, and from an event to the page.

    Raises RuntimeError where an event was lost or came twice.
    """
    [path] = FOLDER.glob(f'??_{NAME}.ipynb')
    questions = list(Known(read(path.read_text(), path.name)).guesses)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        (folder / 'without').mkdir()
        (folder / 'with').mkdir()
        lessons = '--root', str(ROOT)
        with running_class(folder / 'class', *lessons) as opened, ThreadPoolExecutor() as pool:
            without = run_lessons(folder / 'without', 'pass')
            over = threading.Event()
            delays = pool.submit(probe, opened, over)
            tellers = [
                threading.Thread(target=tell_for_a_minute, args=(opened, questions[0], n))
                for n in range(SEATS)
            ]
            for teller in tellers:
                teller.start()
            join = 'from helpers.classroom import *\n'
            join += f'join_class({opened.address!r}, {opened.code!r})'
            inside = run_lessons(folder / 'with', join)
            for teller in tellers:
                teller.join()
            over.set()
            rows = list(csv.reader(opened.csv()))[1:]
            delays = delays.result()
    told = Counter(row[2] for row in rows if row[5] == 'guess')
    wanted = sorted([EVENTS] * SEATS + [len(questions)] * KERNELS)
    if sorted(told.values()) != wanted:
        raise RuntimeError(f'events were lost or came twice: {sorted(told.values())}')
    return inside, without, delays
