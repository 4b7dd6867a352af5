"""The deck of `make present`: copies of lessons as slides whose cells run.

copies.py makes the copies, slides.py says which cell starts a slide, presenter/ is the deck and the
notes window in the browser, server.py what JupyterLab's server does for them.
"""
