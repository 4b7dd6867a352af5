"""The colours and letters of look.css, by name: for figures, and for pictures that scripts draw."""

import re
from pathlib import Path

LOOK_FILE = Path(__file__).with_suffix('.css')
LOOK_CSS = LOOK_FILE.read_text()
LOOK = dict(re.findall(r'--look-([\w-]+): ([^;]+);', LOOK_CSS))
