"""Evolve a robot. ``python train.py --help`` lists the settings; sweep over them with ``-m``."""

import sys
from pathlib import Path

import hydra
from omegaconf import DictConfig

from ncrs.training.hydra import (
    CONFIG_NAME,
    HYDRA_VERSION,
    check_arguments,
    current_job,
    register,
)
from ncrs.training.summary import exit_code, finished_lines, stopped_lines
from ncrs.training.trainer import train
from ncrs_envs.errors import NCRSError

CONF = Path(__file__).resolve().parent / "conf"


@hydra.main(version_base=HYDRA_VERSION, config_path=str(CONF), config_name=CONFIG_NAME)
def main(composed: DictConfig) -> float:
    """Run one job and return the champion's fitness, for Hydra's sweepers."""
    try:
        config, run_dir = current_job(composed)
        result = train(config, run_dir)
    except NCRSError as error:
        sys.exit(f"train.py: {error}")
    if result.stopped_by is not None:
        print("\n".join(stopped_lines(result, result.stopped_by)))
        sys.exit(exit_code(result.stopped_by))
    print("\n".join(finished_lines(result, config)))
    return 0.0 if result.champion is None else result.champion.fitness


if __name__ == "__main__":
    register()
    try:
        check_arguments(sys.argv[1:], CONF)
    except NCRSError as error:
        sys.exit(f"train.py: {error}")
    main()
