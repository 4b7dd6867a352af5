"""The servers and the browser of these tests."""

from support.browser import *  # noqa: F403
