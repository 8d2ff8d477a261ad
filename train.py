"""Evolve a robot: ``ncrs train``, in a checkout. ``--help`` lists the settings; ``-m`` sweeps."""

import sys

from ncrs.cli import TRAIN, main

if __name__ == "__main__":
    main([TRAIN, *sys.argv[1:]])
