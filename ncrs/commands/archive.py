"""``ncrs archive``: statistics of a run's archive, new estimates, and other formats."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from ncrs.commands import add_output_argument, add_seed_argument, output_folder, print_saved
from ncrs.engines.base import AUTO_ENGINE, ENGINES, make_engine, resolve_engine
from ncrs.engines.evaluate import EPISODES
from ncrs.evolution.archive import PAPER_TRIPLES, STANDING_STILL_MARGIN, SUCCESS_FRACTION
from ncrs.evolution.reestimation import Reestimation, reestimate
from ncrs.runs.elites import EliteArchive, load_archive
from ncrs.runs.exports import MEASURES, ExportError, write_csv, write_pyribs
from ncrs.runs.seeds import Stream, seed_row, seed_sequence
from ncrs_envs.mirroring import ScenarioSampling

REESTIMATED_FILE = "archive_reestimated.npz"
CSV_FILE = "archive.csv"
PYRIBS_FILE = "archive_pyribs.pkl.gz"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("run", type=Path, metavar="RUN_DIR", help="a run's folder, or an archive")
    parser.add_argument(
        "--reestimate",
        action="store_true",
        help=f"evaluate all elites on fresh scenarios and save them as {REESTIMATED_FILE}",
    )
    parser.add_argument(
        "--episodes",
        type=int,
        default=EPISODES,
        help="number of fresh scenarios; default: %(default)s",
    )
    parser.add_argument("--engine", choices=[AUTO_ENGINE, *sorted(ENGINES)], default=AUTO_ENGINE)
    add_seed_argument(parser)
    add_output_argument(parser, "the run's")
    parser.add_argument(
        "--export",
        choices=("csv", "pyribs"),
        help=f"write {CSV_FILE}, or {PYRIBS_FILE}: a pickled ribs.archives.GridArchive",
    )
    parser.add_argument(
        "--axes",
        nargs="+",
        choices=MEASURES,
        help="measures that span the grid of the export to pyribs, such as sensors cells for a "
        "heatmap; default: all three",
    )
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    if options.axes is not None and options.export != "pyribs":
        raise ExportError("--axes choose the grid of --export pyribs; give both, or neither.")
    elites = load_archive(options.run)
    print(f"{elites.task.name}, archive of {options.run}:")
    print("\n".join("  " + line for line in archive_lines(elites)))
    if not (options.reestimate or options.export):
        return
    folder = output_folder(options, options.run)
    if options.reestimate:
        elites, found = reestimated(elites, options.engine, options.seed, options.episodes)
        print(f"On {options.episodes} fresh scenarios:")
        print("\n".join("  " + line for line in archive_lines(elites, found.qd_score_error)))
        elites.save(folder / REESTIMATED_FILE)
        print_saved([folder / REESTIMATED_FILE])
    if options.export == "csv":
        write_csv(elites, folder / CSV_FILE)
        print_saved([folder / CSV_FILE])
    elif options.export == "pyribs":
        axes = options.axes or MEASURES
        path = folder / pyribs_file(axes)
        write_pyribs(elites.archive, path, axes)
        print_saved([path])


def pyribs_file(axes: Sequence[str]) -> str:
    """Return the name of the export to pyribs; the axes are part of it unless they are all."""
    name, suffix = PYRIBS_FILE.split(".", 1)
    return PYRIBS_FILE if tuple(axes) == MEASURES else f"{name}_{'_'.join(axes)}.{suffix}"


def reestimated(
    elites: EliteArchive, engine: str, seed: int, episodes: int
) -> tuple[EliteArchive, Reestimation]:
    """Copy an archive and evaluate all elites of the copy on the same fresh scenarios.

    What happened to the robots in training, such as damage, happens in these, too.

    Raises:
        EngineSettingError: If there is no such engine.
        ScenarioError: If ``episodes`` is below 1.
        SeedError: If the seed is negative.
    """
    archive = type(elites.archive).from_state(elites.archive.state())
    perturbations = elites.sampling.perturbations
    sampling = ScenarioSampling(perturbations=perturbations)
    copy = EliteArchive(elites.task, archive, episodes, sampling)
    task, sequence = elites.task, seed_sequence(seed, Stream.COMMAND_REESTIMATION)
    scenarios = copy.sampling.draw(task.task, sequence, episodes, task.grid_size)
    chosen = resolve_engine(engine, task, perturbations.is_any)
    with make_engine(chosen, task) as running:
        found = reestimate(copy.archive, running, scenarios, seed_row(sequence))
    return copy, found


def archive_lines(elites: EliteArchive, qd_score_error: float = math.nan) -> list[str]:
    """Format an archive's statistics as lines of text, with the QD-score's error if it is known."""
    archive = elites.archive
    numbers = archive.statistics()
    possible = len(archive.space.triples)
    filled = int(numbers["filled"])
    paper = score = ""
    error = f" +- {qd_score_error:.4f} standard error" if math.isfinite(qd_score_error) else ""
    if possible != PAPER_TRIPLES:
        paper = f" ({numbers['filled_fraction_of_2024']:.1%} of the paper's {PAPER_TRIPLES:,})"
        score = f" ({numbers['qd_score_of_2024']:.4f} by the paper's {PAPER_TRIPLES:,})"
    lines = [
        f"filled   {filled:,} of {possible:,} measure triples, "
        f"{numbers['filled_fraction']:.1%}{paper}",
        f"QD-score {numbers['qd_score']:.4f}{error}{score}",
    ]
    if filled:
        still = float(archive.column("standing_still").mean())
        lines += [
            f"fitness  best {numbers['best']:.4f}, mean {numbers['mean']:.4f}; "
            f"standing still earns {still:.4f}",
            f"{int(numbers['beat_standing_still']):,} elites beat standing still by "
            f"{STANDING_STILL_MARGIN} or more; {int(numbers['succeed']):,} succeed in "
            f"{SUCCESS_FRACTION:.0%} of {elites.episodes} episodes or more",
        ]
    return lines
