"""The small checkouts of these tests."""

import shutil

import pytest
from support import small_checkout
from support.small_checkout import Checkout

wheels = small_checkout.wheels


@pytest.fixture(scope='module')
def checkout(tmp_path_factory, wheels):
    return Checkout(tmp_path_factory.mktemp('set_up'), wheels)


@pytest.fixture
def installed(checkout):
    """A checkout with one of two packages, and a lock that now wants the other."""
    for folder in checkout.root.glob('.venv*'):
        shutil.rmtree(folder)
    checkout.lock('iniconfig')
    assert checkout.set_up().returncode == 0
    checkout.lock()
    return checkout
