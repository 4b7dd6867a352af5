"""The robot, seen: while a cell runs, afterwards step by step, on paper, and driven by hand."""

from helpers.robot.view.by_hand import drive_by_hand
from helpers.robot.view.live import watch
from helpers.robot.view.replay import replay_drive

__all__ = ['drive_by_hand', 'replay_drive', 'watch']
