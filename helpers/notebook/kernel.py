"""What a helper asks of the kernel that runs it."""


def can_ask(kernel: object) -> bool:
    """Return whether input() gets an answer: in JupyterLab it does, in nbval it does not."""
    return getattr(kernel, '_allow_stdin', False)  # private: a kernel, ipykernel 7.4.0


def hear_while_a_cell_runs(widget: object) -> None:
    """Let the messages of a widget come although the cell still runs.

    ipykernel 7.4 leads them to the thread that spoke last: that of the cell, which is busy. Then
    they go to the subshell, a thread of its own, that JupyterLab addresses.
    """
    vars(widget.comm).pop('_reply_subshell_id', None)  # private: a comm, ipykernel 7.4.0
