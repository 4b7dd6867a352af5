"""All that is used of nbval, which runs each notebook and compares its outputs with the saved ones.

pyproject.toml has its options, tests/nbval_sanitize.cfg what is masked before it compares.
"""

import re
from collections.abc import Callable
from functools import partial

from jupyter_client.manager import KernelManager
from nbval import kernel
from nbval.kernel import RunningKernel
from nbval.plugin import (
    IPyNbCell,
    IPyNbFile,
    comment_markers,
    get_sanitize_patterns,
    metadata_tags,
)

from tools.lessons.lesson import ROOT

__all__ = ['IPyNbCell', 'IPyNbFile', 'RunningKernel', 'comment_markers', 'metadata_tags']

MASKS = ROOT / 'tests' / 'nbval_sanitize.cfg'


def masked(text: str) -> str:
    """Return what nbval compares of an output."""
    for pattern, replacement in get_sanitize_patterns(MASKS.read_text(encoding='utf-8')):
        text = re.sub(pattern, replacement, text)
    return text


def start_kernels_by(manager: Callable[..., KernelManager]) -> Callable[[], None]:
    """Let nbval start its kernels by this manager. The function that it returns undoes that."""
    undo = partial(setattr, kernel, 'KernelManager', kernel.KernelManager)
    kernel.KernelManager = manager
    return undo
