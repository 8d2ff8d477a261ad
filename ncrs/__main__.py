"""``python -m ncrs`` is the ``ncrs`` command."""

from ncrs.cli import main

main()
