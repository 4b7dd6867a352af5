"""The addresses of this machine."""

import socket
from contextlib import suppress

import psutil

THIS_MACHINE = ('127.', '169.254.')  # the latter are of a link, as that to its containers


def in_networks() -> list[str]:
    """Return the addresses by which other machines find this one, that of the Internet first."""
    found = [
        one.address
        for interface in psutil.net_if_addrs().values()
        for one in interface
        if one.family == socket.AF_INET and not one.address.startswith(THIS_MACHINE)
    ]
    with socket.socket(type=socket.SOCK_DGRAM) as nothing_is_sent, suppress(OSError):
        nothing_is_sent.connect(('192.0.2.1', 9))
        first = nothing_is_sent.getsockname()[0]
        found.sort(key=lambda address: address != first)
    return found
