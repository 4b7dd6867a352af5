"""Robots beside a learner's nodes."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from helpers.robot import EMPTY, ROOMS, Robot
from helpers.ros import ros_session, spin_each


def ways(*starts: tuple[type[Node], str]) -> list[float]:
    """Return how far (m) each of three robots comes in 3 s of simulated time.

    A start is the class of a node that drives, and its arguments, as on a command line. The robots
    have the namespaces one, two and three.
    """
    with ros_session():
        robots = [Robot(EMPTY, namespace=name, sim_time=True) for name in ('one', 'two', 'three')]
        executor = SingleThreadedExecutor()
        for node_class, arguments in starts:
            executor.add_node(node_class(cli_args=arguments.split()))
        for robot in robots:
            robot.run(3, executor)
        return [round(robot.pose.x - robot.floor.start.x, 1) for robot in robots]


def with_camera(make_server: Callable[[Robot], Node], act: Callable) -> object:
    """Start a robot, its camera server and a client's node, and return what `act` does with them.

    `act` gets the session, the node and the robot.
    """
    with ros_session() as session:
        robot = Robot(ROOMS)
        client = Node('client')
        spin_each(session, make_server(robot), client)
        return act(session, client, robot)
