"""Launch files in XML and YAML.

elements         reads a file, and checks its tags and attributes
plan             works out which processes it starts
substitutions    $(var ...), $(find-pkg-share ...), $(eval ...)
launcher         runs the processes, prints what they print, and ends them
"""
