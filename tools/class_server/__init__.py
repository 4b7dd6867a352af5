"""A class that sees itself: `make class`. teaching.md says how to use it and what is kept."""
