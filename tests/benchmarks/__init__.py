"""What the session and the recorder cost, measured by `make bench`."""
