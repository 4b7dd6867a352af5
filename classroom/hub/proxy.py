"""The proxy of the hub, which says so if its port is in use."""

import os
import socket
from urllib.parse import urlsplit

from jupyterhub.proxy import ConfigurableHTTPProxy


class Proxy(ConfigurableHTTPProxy):
    """JupyterHub's own, which would go on without a proxy."""

    async def start(self) -> None:
        """Start it, or end the hub with a sentence."""
        self._check_previous_process()  # one that a hub has left, which was killed
        where = urlsplit(self.public_url)
        port = where.port or (443 if where.scheme == 'https' else 80)
        try:
            socket.create_server((where.hostname, port)).close()
        except OSError as problem:
            self.log.critical(
                'The port of %s cannot be used (%s): choose another one, for example '
                "`make hub HUB_ARGS='--url=http://127.0.0.1:8001'`.",
                self.public_url,
                os.strerror(problem.errno),
            )
            self.app.exit(1)
        await super().start()
