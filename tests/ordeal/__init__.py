"""The ordeal: every program of the course that moves a robot meets troubles, and is judged.

    make ordeal LESSON=05 TASK=careful_brake SEED=7 BASE=untimed TROUBLE="scan: silent"

    programs.yaml   which programs there are, what they hear, what they promise
    programs        takes them from the notebooks, and builds them
    troubles        which troubles a program can meet, drawn by a seed
    happen          lets a trouble begin, and end
    trial           one run: a program beside a robot in real time, a base, a trouble
    law             did the robot do what it must?
    run             the command: many trials, and what does not stand
    known.yaml      what does not stand: written by `WRITE=yes`, compared in CI
    sentences       says so in the lessons, beside the program
    inside/         runs in the program's own process: lets callbacks raise and its clock jump
    robot, network  a robot whose sensors can be troubled; a cable between two computers

The law:

- The robot hits nothing, ever.
- Where the program needs what is gone, the robot stands within the program's time.
- It never moves for longer than that without a new command: then nobody drives it.
- When the trouble has ended, the program does what it promises, if it still lives.
"""
