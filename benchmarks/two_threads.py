"""How much faster are two computing threads than one, in a C++ library that releases the GIL?

    python -m benchmarks.two_threads

The library is that of lesson 08: its packages are read from the cells of the notebook and built.
The time of a picture is the best of several rounds. Only an idle machine gives a valid result.
"""

import re
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import nbformat
import numpy as np

from helpers.workspace import Workspace

NOTEBOOK = Path(__file__).resolve().parent.parent / 'notebooks/08_share_code_in_a_cpp_library.ipynb'
PACKAGES = ('image_filters', 'image_filters_py')
ROUNDS, PICTURES, RADIUS = 7, 8, 6


def build() -> None:
    """Build the packages as the lesson leaves them, and make them importable here.

    Raises RuntimeError where the build fails.
    """
    workspace = Workspace('benchmark_two_threads')
    for cell in nbformat.read(NOTEBOOK, as_version=4).cells:
        # A file that the lesson writes twice keeps its last text.
        found = re.match(r'%%write (src/(\w+)/\S+)\n', cell.source)
        if found and found[2] in PACKAGES:
            workspace.write(found[1], cell.source[found.end() :])
    result = workspace.build(*PACKAGES, cmake_args=['-DCMAKE_BUILD_TYPE=Release'])
    if not result.ok:
        raise RuntimeError(str(result))
    workspace.use()


def picture_ms(blur: Callable, threads: int) -> float:
    """Return the time of a picture in milliseconds, where `threads` threads share the pictures."""
    pictures = np.random.default_rng(8).integers(0, 256, (PICTURES, 240, 320, 3), np.uint8)
    blurred = np.empty_like(pictures)
    rounds_s = []
    with ThreadPoolExecutor(threads) as pool:
        for _ in range(ROUNDS):
            started = time.monotonic()
            list(pool.map(blur, pictures, blurred, [RADIUS] * PICTURES))
            rounds_s.append(time.monotonic() - started)
    return 1000 * min(rounds_s) / PICTURES


def main() -> None:
    """Build, measure and print."""
    build()
    import image_filters_py

    for name, blur in (
        ('holding the GIL', image_filters_py.blur_holding_gil),
        ('releasing the GIL', image_filters_py.blur),
    ):
        one, two = picture_ms(blur, 1), picture_ms(blur, 2)
        print(
            f'{name}: one thread {one:.1f} ms a picture, two threads {two:.1f} ms, '
            f'speed-up {one / two:.2f}'
        )


if __name__ == '__main__':
    main()
