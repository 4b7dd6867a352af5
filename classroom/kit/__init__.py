"""What a lecturer hands in or hands out around the lessons: syllabus, rubric, exam."""
