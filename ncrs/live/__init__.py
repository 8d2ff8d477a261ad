"""Robots that live in a browser: the kernels in JavaScript, and the page that runs them."""

DEFAULT_ELITES = 12
"""Number of a run's elites on its page, unless another is asked for."""
