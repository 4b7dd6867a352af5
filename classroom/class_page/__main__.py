"""Open a class, until Ctrl+C. After a crash, the next start goes on with it.

python -m classroom.class_page --lan --port 8765
"""

import argparse
import asyncio
import fcntl
import os
import signal
import socket
import sys
import threading
import webbrowser
from contextlib import suppress
from pathlib import Path

from tornado.netutil import bind_sockets

from classroom.class_page import folder, page_file
from classroom.class_page.addresses import in_networks
from classroom.class_page.lessons import Known
from classroom.class_page.store import ClassStore
from classroom.class_page.web import PAGE_EVERY_S, Room, application, serve
from helpers.lesson import GLOSSARY, ROOT, lessons

FILE = 'class.sqlite'


def known_lessons(root: Path = ROOT) -> list[Known]:
    """Return what is known of the lessons below a folder."""
    return [Known(one) for one in lessons(root / 'notebooks') if one.number != GLOSSARY]


async def hold(store: ClassStore, options: argparse.Namespace) -> None:
    """Hold the class, until its end."""
    over = asyncio.Event()

    def end() -> None:
        room.over = True
        over.set()

    room = Room(store, end)
    asyncio.get_running_loop().add_signal_handler(signal.SIGINT, end)
    address = '0.0.0.0' if options.lan else '127.0.0.1'
    sockets = bind_sockets(options.port, address, socket.AF_INET)
    server = serve(application(room), sockets, behind_proxy=bool(options.url))
    port = sockets[0].getsockname()[1]
    page = f'http://localhost:{port}/{store.secret}/'
    if options.url:
        one, others = options.url.rstrip('/'), []
    else:
        one, *others = [f'{at}:{port}' for at in (options.lan and in_networks()) or ['127.0.0.1']]
    room.joins = [
        '# Type this into a new cell of a lesson, then press Shift+Enter:',
        'from helpers.checks import *',
        f"join_class('{one}', '{store.code}')",
    ]
    print('For the wall:', *room.joins, sep='\n    ')
    if others:
        print(f'In the place of {one}, for students in other networks:', *others)
    print('Your page:', page, sep='\n    ')
    if not options.lan and not options.url:
        print('Only this machine can join. LAN=yes lets the networks of this machine in.')
    if store.went_on:
        print('The class that was broken off goes on, with what it was told.')
    print('Ctrl+C ends the class and deletes what it was told.', flush=True)
    page_file().write_text(page)
    if options.browser:
        # One that lives in the terminal ends when it is closed.
        threading.Thread(target=webbrowser.open, args=[page], daemon=True).start()
    try:
        await over.wait()
        await asyncio.sleep(2 * PAGE_EVERY_S)  # wall and slides say that it is over
    finally:
        page_file().unlink(missing_ok=True)
        server.stop()
        await server.close_all_connections()


def main(arguments: list[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = argparse.ArgumentParser(prog='make class', description='Open a class.')
    parser.add_argument('--lan', action='store_true', help='let the networks of this machine in')
    parser.add_argument('--url', default='', help='of a proxy before it, such as https://class.org')
    parser.add_argument('--port', type=int, default=8765)
    parser.add_argument('--root', type=Path, default=ROOT, help='of the lessons')
    parser.add_argument('--no-browser', dest='browser', action='store_false')
    options = parser.parse_args(arguments)
    folder().mkdir(mode=0o700, parents=True, exist_ok=True)
    try:
        # Until this process ends: another class, at its end, would delete what this one was told.
        fcntl.flock(os.open(folder(), os.O_RDONLY), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        print('A class is open here already: Ctrl+C in its terminal ends it.', file=sys.stderr)
        return 1
    store = ClassStore(folder() / FILE, known_lessons(options.root))
    try:
        asyncio.run(hold(store, options))
    except OSError as error:
        store.close()
        print(
            f'Port {options.port} cannot be used ({error.strerror}). Is another class open? '
            f'Name another one: make class PORT={options.port + 1}',
            file=sys.stderr,
        )
        return 1
    store.end()
    print('The class is over. What it was told is deleted.')
    return 0


if __name__ == '__main__':
    with suppress(KeyboardInterrupt):  # before the class was open
        sys.exit(main())
