"""What lessons import: packages of one purpose, each with one API.

The API of a package is what its `__init__.py` names: others use that, and import nothing else from
it. A package imports only from those that stand above it in this list:

    lesson      what a lesson is: steps, tasks, guesses and notes, read from its notebook
    notebook    what a cell needs before ROS comes: interrupts, a bar, lines, letters, colours
    waits       what waits in any program, for what, and why that does not come
    ros         a session in a kernel: its domain, its threads, its log, what is not connected
    machine     this machine: what it has, what is missing, tools of a build, folders of workspaces
    robot       a small robot behind real messages; it also runs as a program
    recording   records of what callbacks did, and the model of a queue that explains them
    replay      step through a run: what waits, what runs, what is lost, and why
    waits_view  how one sees what waits: the circle that has closed
    guesses     a guess as an object in a picture: what may be answered, and how it looks
    robot_view  how one sees the robot, and drives it by hand
    plots       pictures of recorded and of predicted runs, of graphs and of drives
    workspace   a colcon workspace for a notebook, and processes that end
    fusion      one pose from several imperfect sensors; its nodes also run as programs
    faults      somebody else's robots, each with a fault that one finds and mends
    patrol      robots that are driven by the program that a learner writes in the last lessons
    trials      what code of a learner does where a lesson puts it: at a gate, at a stop
    checks      guesses and tasks: what is right, what the student's code did, and a hint
    kernel      what each kernel of this environment gets when it starts

tests/test_doors.py reads the list, and checks the imports. tests/test_light_imports.py says what
the packages that run as programs must not load.
"""
