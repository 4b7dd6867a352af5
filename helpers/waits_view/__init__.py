"""How one sees what waits: the circle in which the callbacks of a program wait for each other.

`helpers.waits` finds it, and needs only rclpy. Here it is drawn, as the circle of a recorded run.
"""

from helpers.waits_view.circle import Circle, what_waits

__all__ = ['Circle', 'what_waits']
