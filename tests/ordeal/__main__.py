"""`python tests/ordeal --help`: what `make ordeal` runs."""

import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).resolve().parents[1])  # for `ordeal`

from ordeal.run import main  # noqa: E402

if __name__ == '__main__':
    sys.exit(main())
