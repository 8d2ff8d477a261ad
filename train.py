"""Evolve a robot: ``ncrs train``, in a checkout. ``--help`` lists the settings; ``-m`` sweeps."""

import sys

from ncrs.training.launch import launch

if __name__ == "__main__":
    launch(sys.argv[1:])
