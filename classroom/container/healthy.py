"""Does the server of this container answer? The exit status says it, to podman and docker."""

import os
import urllib.request

port = os.environ.get('JUPYTER_PORT', '8888')
prefix = os.environ.get('JUPYTERHUB_SERVICE_PREFIX', '/')
# Not by a proxy of the machine, which is passed on to the container.
direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
direct.open(f'http://127.0.0.1:{port}{prefix}api', timeout=4).close()
