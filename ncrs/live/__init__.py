"""Robots that live in a browser: the kernels in JavaScript, and the page that runs them."""
