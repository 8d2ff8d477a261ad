"""Building of a report: robots are recorded, page and data written into a folder."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ncrs.automaton.channels import STATE_LIMIT
from ncrs.automaton.growth import record_growth
from ncrs.automaton.nca import NCAPopulation
from ncrs.live.build import BASE_STYLE, SHARED, page_part, page_text
from ncrs.live.build import PAGE_FILE as LIVE_PAGE
from ncrs.live.robots import LiveRobot, live_robot
from ncrs.live.world import world
from ncrs.report.curves import Curve, load_curves
from ncrs.report.encoding import pack, quantize, write_data
from ncrs.report.folder import check_folder, new_report
from ncrs.report.overview import charts, facts, robot_table, setting_lines, title
from ncrs.report.robots import ReportError, Robots, load_robots, lone_robot
from ncrs.runs.published import PublishedChampion
from ncrs.runs.robot import EvolvedRobot
from ncrs.runs.seeds import Stream, seed_sequence
from ncrs.runs.settings import TrainConfig, config_from_dict, load_config
from ncrs_envs.body import sensor_mask, wheel_mask
from ncrs_envs.physics import MAX_TRANSLATION
from ncrs_envs.scenario import WALL_EXTENT, Scenario, sample_scenarios
from ncrs_envs.tasks import MAX_EPISODE_STEPS, TaskSettings, playfield

REPORT_FOLDER = "report"
PAGE_FILE = "index.html"
DATA_FOLDER = "data"
OVERVIEW_FILE = f"{DATA_FOLDER}/overview.js"
ALL, CHAMPION = "all", "champion"
"""Choices of robots to record."""
CHUNK = 20
"""Number of robots in a data file: few enough to load at a click, enough to keep files few."""
_BATCH = 12 * CHUNK
"""Number of robots recorded at once."""
_STYLE = "report.css"
_SCRIPTS = (
    "data.js",
    "charts.js",
    "player.js",
    "live.js",
    "growth.js",
    "robot.js",
    "archive.js",
    "app.js",
)


@dataclass(frozen=True)
class ReportOptions:
    """Options of a report.

    Raises:
        ReportError: If ``elites`` is neither "all" nor "champion".
    """

    episodes: int = 2
    """Number of fresh episodes of every robot, in the same scenarios for all."""
    elites: str = ALL
    """Robots to record: "all", or "champion" for the champion alone."""
    seed: int = 0
    """Seed for sampling the scenarios."""

    def __post_init__(self) -> None:
        if self.elites not in (ALL, CHAMPION):
            raise ReportError(f"elites must be {ALL!r} or {CHAMPION!r}, got {self.elites!r}.")


@dataclass(frozen=True)
class Report:
    """A written report."""

    page: Path
    """The file to open."""
    robots: int
    """Number of robots."""
    recorded: int
    """Number of robots with growth and episodes."""
    size: int
    """Size of all files in bytes."""


class _Subject(NamedTuple):
    """What a report is about."""

    name: str
    """Name of the run or the robot."""
    config: TrainConfig | None
    """Settings of the run that made it; None if they are not known."""
    robots: Robots
    curves: Mapping[str, Curve]
    is_run: bool = True


def build_report(
    run_dir: str | Path,
    folder: str | Path | None = None,
    options: ReportOptions | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Report:
    """Write a run's report, in place of an older one.

    Args:
        run_dir: Folder of the run.
        folder: Folder of the page; by default ``report`` in the run's folder.
        options: Robots and episodes to record; None for the defaults.
        progress: Function to call with the number of robots recorded so far, and in all.

    Raises:
        ConfigError: If the folder holds no run, or neither an archive nor a champion.
        ReportError: If there is no robot to show, or ``folder`` holds no report, but other files.
        ScenarioError: If the number of episodes is not a positive integer.
        SeedError: If the seed is not a non-negative integer.
        CheckpointError: If a file of the run is damaged.
    """
    run_dir = Path(run_dir)
    options = ReportOptions() if options is None else options
    config = load_config(run_dir)
    robots = load_robots(run_dir)
    if options.elites == CHAMPION and robots.champion is None:
        raise ReportError(f"{run_dir} has no champion yet; record all elites, or train for longer.")
    target = run_dir / REPORT_FOLDER if folder is None else Path(folder)
    subject = _Subject(run_dir.resolve().name, config, robots, load_curves(run_dir))
    return _write_report(subject, Path(os.path.abspath(target)), options, progress)


def build_robot_report(
    robot: EvolvedRobot, folder: str | Path, options: ReportOptions | None = None
) -> Report:
    """Write a report on one robot, in place of an older one.

    Args:
        robot: Robot to show, such as a published champion or an elite.
        folder: Folder of the page.
        options: Episodes to record; None for the defaults.

    Raises:
        ReportError: If ``folder`` holds no report, but other files.
        ScenarioError: If the number of episodes is not a positive integer.
        SeedError: If the seed is not a non-negative integer.
    """
    config = None
    if isinstance(robot, PublishedChampion):
        config = config_from_dict(robot.card["config"])
    subject = _Subject(robot.title, config, lone_robot(robot), {}, is_run=False)
    return _write_report(subject, Path(os.path.abspath(folder)), options or ReportOptions(), None)


def _write_report(
    subject: _Subject,
    target: Path,
    options: ReportOptions,
    progress: Callable[[int, int], None] | None,
) -> Report:
    if subject.robots.task.needs_box2d:
        raise ReportError(
            f"{subject.robots.task.name} {subject.robots.task.not_compiled}, which a report "
            "cannot show; use ncrs film or ncrs render."
        )
    check_folder(target)  # before robots are recorded, which takes long
    robots, curves = subject.robots, subject.curves
    settings = robots.task
    scenarios = sample_scenarios(
        settings.task,
        seed_sequence(options.seed, Stream.REPORT),
        options.episodes,
        settings.grid_size,
    )
    first = robots.elites if options.elites == CHAMPION else 0
    overview = {
        "run": subject.name,
        "world": world(settings, scenarios),
        "robots": robot_table(robots),
        "charts": charts(curves),
        "records": {"first": first, "chunk": CHUNK},
        "limits": _limits(settings),
    }
    with new_report(target) as made:
        (made / DATA_FOLDER).mkdir()
        write_data(made / OVERVIEW_FILE, "overview", 0, overview)
        page = {
            "title": title(settings.task, subject.config),
            "run": overview["run"],
            "facts": facts(subject.config, robots, curves),
            "settings": {} if subject.config is None else setting_lines(asdict(subject.config)),
            "has_archive": robots.elites > 0,
            "is_run": subject.is_run,
            "has_charts": bool(overview["charts"]),
            "scripts": (*SHARED, *_SCRIPTS),
        }
        _write_page(made, page)
        write_parts(made)
        live = page_text([_first_robot(robots)], options.seed)
        (made / LIVE_PAGE).write_text(live, encoding="utf-8")
        _write_robots(made / DATA_FOLDER, robots, first, scenarios, progress)
        size = sum(path.stat().st_size for path in made.rglob("*") if path.is_file())
    return Report(target / PAGE_FILE, len(robots), len(robots) - first, size)


def _limits(settings: TaskSettings) -> dict[str, float]:
    """Return the maximum magnitudes of the values that ``quantize`` rounds to integers."""
    reach = WALL_EXTENT * playfield(settings.grid_size) + MAX_TRANSLATION * MAX_EPISODE_STEPS
    return {"position": reach, "angle": float(np.pi), "state": STATE_LIMIT, "unit": 1.0}


def _write_page(folder: Path, values: dict[str, Any]) -> None:
    """Write the page itself."""
    try:
        from jinja2 import Environment, StrictUndefined
    except ImportError as error:
        raise ReportError(
            "A report needs jinja2, which is not installed: pip install 'ncrs[viz]'."
        ) from error
    source = files("ncrs.report") / "page"
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    template = environment.from_string((source / f"{PAGE_FILE}.j2").read_text(encoding="utf-8"))
    (folder / PAGE_FILE).write_text(template.render(values), encoding="utf-8")


def write_parts(folder: Path) -> None:
    """Write the style and the scripts that all pages share."""
    source = files("ncrs.report") / "page"
    for name in (_STYLE, *_SCRIPTS):
        (folder / name).write_text((source / name).read_text(encoding="utf-8"), encoding="utf-8")
    for name in (BASE_STYLE, *SHARED):
        (folder / name).write_text(page_part(name), encoding="utf-8")


def _first_robot(robots: Robots) -> LiveRobot:
    """Return the robot that the live page opens on: the champion, or the fittest elite."""
    if robots.champion is not None:
        return live_robot(robots.champion)
    best = int(robots.fitness.argmax())
    elite = EvolvedRobot(
        robots.genomes[best],
        robots.bodies[best],
        robots.task,
        float(robots.fitness[best]),
        float(robots.success[best]),
        name="best elite",
    )
    return live_robot(elite)


def _write_robots(
    data: Path,
    robots: Robots,
    first: int,
    scenarios: Sequence[Scenario],
    progress: Callable[[int, int], None] | None,
) -> None:
    """Record the robots from ``first`` on, and write their data and genomes."""
    settings = robots.task
    for start in range(first, len(robots), _BATCH):
        rows = slice(start, min(start + _BATCH, len(robots)))
        records = _record(robots, rows, scenarios, settings)
        genomes = [pack(genome) for genome in robots.genomes[rows]]
        for offset in range(0, len(records), CHUNK):
            index = (start - first + offset) // CHUNK
            part = slice(offset, offset + CHUNK)
            write_data(data / f"robots-{index}.js", "robots", index, records[part])
            write_data(data / f"genomes-{index}.js", "genomes", index, genomes[part])
        if progress is not None:
            progress(rows.stop - first, len(robots) - first)


def _record(
    robots: Robots, rows: slice, scenarios: Sequence[Scenario], settings: TaskSettings
) -> list[dict[str, Any]]:
    """Record growth, channels and episodes of some robots, in the form that the page reads."""
    from ncrs.report.episodes import record_episodes

    limits = _limits(settings)
    population = NCAPopulation(robots.genomes[rows], settings.task)
    bodies = robots.bodies[rows]
    growth = record_growth(population, settings.grid_size)
    grown = growth.bodies.astype(np.uint8)
    states = quantize(np.moveaxis(growth.states, -1, 2), limits["state"], np.int8)
    recorded = record_episodes(robots.genomes[rows], bodies, scenarios, settings)
    angles = np.remainder(recorded.poses[..., 2] + np.pi, 2.0 * np.pi) - np.pi
    columns = {
        "position": quantize(recorded.poses[..., :2], limits["position"], np.int16),
        "angle": quantize(angles, limits["angle"], np.int16),
        "reward": quantize(recorded.rewards, limits["unit"], np.uint16),
        "control": quantize(np.moveaxis(recorded.control_states, -1, 2), limits["state"], np.int8),
    }
    if settings.task.has_ball:
        columns["ball"] = quantize(recorded.balls, limits["position"], np.int16)
    sensors = quantize(recorded.sensors, limits["unit"], np.uint8)
    gas = quantize(recorded.gas, limits["unit"], np.int8)
    records = []
    for robot, body in enumerate(bodies):
        episodes = [
            {
                **{name: pack(values[robot, episode]) for name, values in columns.items()},
                "sensors": pack(sensors[robot, episode][:, sensor_mask(body)]),
                "gas": pack(gas[robot, episode][:, wheel_mask(body)]),
                "fitness": float(recorded.fitness[robot, episode]),
                "successStep": int(recorded.success_steps[robot, episode]),
            }
            for episode in range(len(scenarios))
        ]
        records.append(
            {"bodies": pack(grown[robot]), "states": pack(states[robot]), "episodes": episodes}
        )
    return records
