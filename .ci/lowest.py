"""Print the lower bounds of setup.cfg as pip constraints: the oldest versions that are allowed."""

import configparser
import re
from pathlib import Path

CONFIG = Path(__file__).parents[1] / "setup.cfg"
LEFT_OUT = ("torch", "box2d-py")
"""What the environment has already, in a build that the index does not offer; what is compiled."""

parser = configparser.ConfigParser()
parser.read(CONFIG)
requirements = parser["options"]["install_requires"].splitlines()
for extra in parser["options.extras_require"].values():
    requirements += extra.splitlines()
bounds = {}
for requirement in requirements:
    found = re.match(r"([A-Za-z0-9_.-]+)(?:\[[^]]*\])?>=([0-9.]+)", requirement.strip())
    if found and found[1] not in LEFT_OUT:
        bounds[found[1]] = found[2]
for name, version in sorted(bounds.items()):
    print(f"{name}=={version}")
