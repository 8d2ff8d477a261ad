"""``python -m ncrs``: the ``ncrs`` command."""

from ncrs.cli import main

if __name__ == "__main__":
    main()
