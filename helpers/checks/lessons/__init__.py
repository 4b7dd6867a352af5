"""What the tasks of each lesson are judged by: a module for a lesson, with the lesson's name."""
