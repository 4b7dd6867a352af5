"""Everything for a class: README.md says what each part is for."""
