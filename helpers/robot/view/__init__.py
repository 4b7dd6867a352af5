"""The robot, seen: while a cell runs, afterwards step by step, on paper, and driven by hand."""
