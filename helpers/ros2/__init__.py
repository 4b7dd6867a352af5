"""The `ros2` command for an environment of wheels, with the words of the real one.

    main       finds the verb that was typed, and prints a user's mistake as one sentence
    topic ...  one module a verb: its first line is its help, its `@command` functions what it does
    _...       what several verbs need

A new file is a new verb.
"""
