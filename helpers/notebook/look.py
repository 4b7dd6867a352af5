"""The colours and letters of look.css, by name: for figures, and for pictures that scripts draw."""

import re
from pathlib import Path

LOOK_CSS = Path(__file__).with_suffix('.css').read_text()
LOOK = dict(re.findall(r'--look-([\w-]+): ([^;]+);', LOOK_CSS))
