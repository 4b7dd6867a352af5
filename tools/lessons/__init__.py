"""The tools for the lessons: run and save them, keep their rules, add one."""
