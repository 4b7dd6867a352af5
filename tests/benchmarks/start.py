"""From a fresh clone with empty caches to JupyterLab's answer, beside the packages asked for alone.

    make bench [ROUNDS=3]        on an idle machine, with a network

No number fails: a reader judges the ratios. Neither side has uv in a cache. The reference is given
uv; a course that must fetch it pays for that.
"""

import os
import resource
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from contextlib import suppress
from pathlib import Path

import pandas as pd

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = "jupyterlab nbval 'ros-jazzy-rclpy[fastrtps]==7.1.6' ros-jazzy-common-interfaces==5.3.6"
LAB = '--no-browser --ServerApp.port={port} --ServerApp.port_retries=0 --allow-root'
COMMANDS = {
    'make lab': 'exec make lab BROWSER=no PORT={port}',
    'packages alone': '{uv} venv --quiet --python {python} .venv && '
    f'{{uv}} pip install --quiet {PACKAGES} pandas matplotlib && exec .venv/bin/jupyter lab {LAB}',
}


def start(command: str) -> dict[str, float]:
    """Return seconds and CPU seconds until JupyterLab answers, and the size of .venv."""
    with tempfile.TemporaryDirectory() as folder, socket.create_server(('127.0.0.1', 0)) as free:
        clone, port = Path(folder, 'clone'), free.getsockname()[1]
        free.close()
        subprocess.run(['git', 'clone', '--quiet', ROOT, clone], check=True)
        # Without the variables that `make` sets, and with empty caches and settings.
        kept = {k: v for k, v in os.environ.items() if not k.startswith(('JUPYTER', 'IPYTHON'))}
        kept |= {name: f'{folder}/{name}' for name in ('UV_CACHE_DIR', 'PIP_CACHE_DIR')}
        kept |= {'JUPYTER_CONFIG_DIR': f'{folder}/jupyter', 'IPYTHONDIR': f'{folder}/ipython'}
        python, uv = sys._base_executable, shutil.which('uv') or ROOT / '.uv/bin/uv'
        words = command.format(port=port, python=python, uv=uv)
        before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        quiet = {'stdout': subprocess.DEVNULL, 'stderr': subprocess.DEVNULL}
        process = subprocess.Popen(['/bin/sh', '-c', words], cwd=clone, env=kept, **quiet)
        while process.poll() is None:
            with suppress(OSError), urllib.request.urlopen(f'http://127.0.0.1:{port}/api'):
                break
            time.sleep(0.02)
        seconds = time.perf_counter() - started
        process.terminate()
        if process.wait() == 2:
            raise RuntimeError(f'This failed: {words}')
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        files = [f for f in clone.glob('.venv/**/*') if f.is_file() and not f.is_symlink()]
        return {
            'seconds': seconds,
            'CPU seconds': after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
            'MB': sum(f.stat().st_size for f in files if f.suffix != '.pyc') / 1e6,
            'packages': len(list(clone.glob('.venv/lib/*/site-packages/*.dist-info'))),
        }


if __name__ == '__main__':
    rounds = int(sys.argv[1]) if sys.argv[1:] else 3
    starts = [
        {'command': name} | start(words) for _ in range(rounds) for name, words in COMMANDS.items()
    ]
    medians = pd.DataFrame(starts).groupby('command', sort=False).median()
    medians.loc['ratio'] = medians.iloc[0] / medians.iloc[1]
    print(pd.DataFrame(starts).to_string(), medians.to_string(), sep='\n\n')
