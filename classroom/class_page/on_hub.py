"""The class of a JupyterHub: a service of the hub, for which its administrators need no secret.

The hub knows from the token of a server which student it belongs to. A seat is known by the hash of
that name. The page is for people with the scope `access:services!service=class`, which
administrators have. The deck runs on another machine, where nobody has logged in: its address holds
the secret of the class, as without a hub.
"""

import asyncio
import os
import secrets
import signal
import socket
from pathlib import Path
from urllib.parse import urlsplit

from jupyterhub.services.auth import HubOAuthCallbackHandler, HubOAuthenticated
from tornado import web
from tornado.netutil import bind_sockets

from classroom.class_page import events
from classroom.class_page.__main__ import known_lessons
from classroom.class_page.store import ClassStore
from classroom.class_page.web import Instructor, Room, Student, serve

PREFIX = os.environ['JUPYTERHUB_SERVICE_PREFIX']
# The hub derives this from the service's `url`. That of `make hub` has none, and PREFIX is enough.
os.environ.pop('JUPYTERHUB_OAUTH_CALLBACK_URL', None)


class HubStudent(HubOAuthenticated, Student):
    """The door of the students, who are in the class at once."""

    async def post(self, what: str) -> None:
        """Take a message of a student whom the hub knows."""
        user = await self.hub_auth.user_for_token(super().token(), sync=False)
        if user is None or user['kind'] != 'user':
            self.refuse(403, 'The hub does not know this student.')
            return
        self._token = f'{self.room.store.secret} {user["name"]}'
        if self.room.store.seat(self._token) is None:
            try:
                self.room.store.join(self._token, '')
            except ValueError as why:
                self.refuse(403, str(why))
                return
        super().post(what)

    def token(self) -> str:
        """Return what stands for the student's name, which is kept nowhere."""
        return self._token

    def check_xsrf_cookie(self) -> None:
        """Ask for none: a student's kernel has a token, not a cookie."""

    def join(self) -> None:
        """Say which seat the student has; the hub's login takes the place of the code."""
        wanted = events.parse(self.request.body, events.JOIN)
        seat = self.room.store.join(self.token(), events.plain_name(wanted['name']))
        self.finish({'seat': seat, 'token': ''})


class HubInstructor(HubOAuthenticated, Instructor):
    """The door of the administrators."""

    def prepare(self) -> None:
        """Let the hub decide, below."""

    @web.authenticated
    async def get(self, secret: str, name: str) -> None:
        """Answer with the page, one of its files, or its changes as they come."""
        self.xsrf_token  # noqa: B018 - sets the cookie that the page sends back
        await super().get(secret, name)

    @web.authenticated
    def post(self, secret: str, name: str) -> None:
        """Do what a button of the page says."""
        super().post(secret, name)


async def hold(store: ClassStore) -> None:
    """Hold the class until the hub ends."""
    over = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, over.set)
    room = Room(store, stop=store.forget)
    room.joins = ['On this hub you are in the class.']
    room.deck_asks = True
    application = web.Application(
        [
            (f'{PREFIX}oauth_callback', HubOAuthCallbackHandler),
            (f'{PREFIX}(join|events|leave)', HubStudent, {'room': room}),
            (f'{PREFIX}([0-9a-f]{{16}})/(.*)', Instructor, {'room': room}),
            (f'{PREFIX}()(.*)', HubInstructor, {'room': room}),
        ],
        cookie_secret=secrets.token_bytes(32),
        log_function=lambda handler: None,
    )
    where = urlsplit(os.environ['JUPYTERHUB_SERVICE_URL'])
    address = os.environ.get('CLASS_LISTEN', where.hostname)
    serve(application, bind_sockets(where.port, address, socket.AF_INET))
    await over.wait()


if __name__ == '__main__':
    store = ClassStore(Path(os.environ['CLASS_FOLDER'], 'class.sqlite'), known_lessons())
    asyncio.run(hold(store))
    store.end()
