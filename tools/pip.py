"""Run pip: this Python's own, or the one that `venv` would install. Debian keeps that one apart.

python3 -I tools/pip.py ARGUMENT...    any Python from 3.8 on, which need not be the one for .venv
"""

import glob
import importlib.util
import os
import runpy
import sys
import sysconfig
import tempfile

if not importlib.util.find_spec('pip'):
    import ensurepip

    bundled = os.path.join(os.path.dirname(ensurepip.__file__), '_bundled')
    for folder in (sysconfig.get_config_var('WHEEL_PKG_DIR'), bundled):
        sys.path[:0] = glob.glob(f'{folder}/pip-*.whl')
    # From a wheel, pip starts each build with a script in the folder for temporary files. A stray
    # copy.py beside it would hide Python's own: so this folder is a new one.
    private = tempfile.TemporaryDirectory()
    tempfile.tempdir = private.name
runpy.run_module('pip', run_name='__main__', alter_sys=True)
