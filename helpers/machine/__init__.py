"""This machine: what it has, what is missing, and the tools with which a package is built."""
