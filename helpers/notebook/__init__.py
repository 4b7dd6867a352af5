"""What a cell of a notebook needs before ROS comes: interrupts, a bar, lines, letters, colours."""
