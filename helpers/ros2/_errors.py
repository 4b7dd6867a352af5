"""What ends a command."""


class CommandError(Exception):
    """A user's mistake: one sentence for stderr, and the exit status of the real command."""

    def __init__(self, sentence: object, status: int = 1) -> None:
        super().__init__(str(sentence))
        self.status = status
