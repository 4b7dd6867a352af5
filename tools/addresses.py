"""The addresses of this machine."""

import socket

import psutil


def in_networks() -> list[str]:
    """Return the addresses by which other machines find this one."""
    return [
        one.address
        for interface in psutil.net_if_addrs().values()
        for one in interface
        if one.family == socket.AF_INET and not one.address.startswith('127.')
    ]
