"""Evolve a robot. ``python train.py --help`` lists the settings; sweep over them with ``-m``."""

import sys

import hydra
from omegaconf import DictConfig

from ncrs.training.hydra import check_arguments, current_job, register
from ncrs.training.summary import exit_code, finished_lines, stopped_lines
from ncrs.training.trainer import train
from ncrs_envs.errors import NCRSError


@hydra.main(version_base="1.3", config_path="conf", config_name="config")
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
        check_arguments(sys.argv[1:])
    except NCRSError as error:
        sys.exit(f"train.py: {error}")
    main()
