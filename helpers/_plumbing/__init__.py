"""What helpers need and no lesson imports."""
