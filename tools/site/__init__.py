"""The lessons as a web site and as a book."""
