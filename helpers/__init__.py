"""What a notebook needs and a terminal does not: rooms of one purpose, with one door each.

A room is a folder, and its `__init__.py` is the door: others use what it names, and import nothing
from behind it. A room imports only from the rooms that stand above it in this list:

    lesson     what a lesson is: steps, tasks, guesses and notes, read from its notebook
    notebook   what a cell needs before ROS comes: interrupts, a bar, lines, letters, colours
    ros        a session in a kernel: its domain, its threads, its log, what waits for what
    machine    this machine: what it has, what is missing, tools of a build, folders of workspaces
    recording  records of what callbacks did, and the model of a queue that explains them
    replay     step through a run: what waits, what runs, what is lost, and why
    plots      pictures of recorded and of predicted runs, of graphs and of drives
    workspace  a colcon workspace for a notebook, and processes that end
    robot      a small robot behind real messages, and how one sees it
    fusion     one pose from several imperfect sensors
    faults     somebody else's robots, each with a fault that one finds and mends
    checks     guesses and tasks: what is right, what the student's code did, and a hint

tests/test_doors.py reads the list, and checks the imports.
"""
