"""The `ros2` command for an environment of wheels, with the words of the real one.

api              what other programs may import: nothing else of this package is for them
main             finds the verb that was typed, and prints a user's mistake as one sentence
verbs/           one module for each verb: its first line is its help, its `@command` functions
                 are its commands. A new file is a new verb
commands         how a function becomes a command
index            which packages, executables and interfaces are installed
interfaces       the files of interfaces, and what is shown of them
domain, records  which domain a command joins
graph            the node of a command; discovery: when it has seen all there is
names, values    the names in the graph; messages as text
launch/          launch files: read, worked out, run
"""
