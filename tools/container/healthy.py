"""Does the server of this container answer? The exit status says it, to podman and docker."""

import os
import urllib.request

port = os.environ.get('JUPYTER_PORT', '8888')
prefix = os.environ.get('JUPYTERHUB_SERVICE_PREFIX', '/')
urllib.request.urlopen(f'http://127.0.0.1:{port}{prefix}api', timeout=4).close()
