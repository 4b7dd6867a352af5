"""How hypothesis chooses its examples. A conftest imports this."""

from hypothesis import settings

# `make test` tries the same examples every time: what passed yesterday passes in class. New ones:
# `make test PYTEST_ARGS='--hypothesis-profile=explore tests/test_queue_model.py'`, twenty times as
# many; what fails there becomes an @example. No deadline, for overloaded machines.
settings.register_profile('same', deadline=None, derandomize=True, print_blob=True)
settings.register_profile('explore', deadline=None, print_blob=True, max_examples=2000)
settings.load_profile('same')
