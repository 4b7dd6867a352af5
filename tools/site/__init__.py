"""The lessons and documents as a web site."""
