"""What each kernel of this environment gets when it starts: an extension of IPython.

tools/jupyter/ipython_config.json names this package. It stands last in the list of packages, so it
may know all of them; it loads them only when a sentence of theirs is needed.
"""

from helpers.kernel.extension import load_ipython_extension, unload_ipython_extension

__all__ = ['load_ipython_extension', 'unload_ipython_extension']
