"""How much faster are two computing threads than one, in a C++ library that releases the GIL?

The library is that of lesson 08. The cost is that of a picture, where the threads share eight.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from benchmarks.lessons import build, workspace_of
from benchmarks.table import Row, seconds

PACKAGES = ('image_filters', 'image_filters_py')
ROUNDS, PICTURES, RADIUS = 7, 8, 6


def picture_s(blur: Callable, threads: int) -> list[float]:
    """Return the seconds of a picture in each round, where `threads` threads share the pictures."""
    pictures = np.random.default_rng(8).integers(0, 256, (PICTURES, 240, 320, 3), np.uint8)
    blurred = np.empty_like(pictures)
    with ThreadPoolExecutor(threads) as pool:
        rounds = seconds(
            lambda: list(pool.map(blur, pictures, blurred, [RADIUS] * PICTURES)), ROUNDS
        )
    return [each / PICTURES for each in rounds]


def measure() -> list[Row]:
    """Return two threads against one, for the filter with and without the GIL."""
    workspace = workspace_of('08', *PACKAGES, name='two_threads')
    build(workspace, *PACKAGES, cmake_args=['-DCMAKE_BUILD_TYPE=Release'])
    workspace.use()
    import image_filters_py

    filters = {
        'holding the GIL': image_filters_py.blur_holding_gil,
        'releasing the GIL': image_filters_py.blur,
    }
    return [
        Row(f'a picture, 2 threads, {name}', picture_s(blur, 2), '1 thread', picture_s(blur, 1))
        for name, blur in filters.items()
    ]
