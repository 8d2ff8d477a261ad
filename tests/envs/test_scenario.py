"""Scenario records, and the laws that their placements follow (paper, section 4)."""

import dataclasses
import itertools
import pickle

import numpy as np
import pytest

from ncrs_envs.overlaps import square_overlaps
from ncrs_envs.scenario import (
    MAX_NOISE,
    Scenario,
    ScenarioError,
    sample_scenario,
    sample_scenarios,
    wall_quads,
)
from ncrs_envs.tasks import TASKS, TaskError, get_task, playfield

SIZES = [3, 5, 9]
DRAWS = 1500
KS_BOUND = 1.95
COLUMNS = np.array([-0.6, -0.3, 0.3, 0.6])
CORNERS = np.array([(-0.6, -0.6), (0.6, -0.6), (0.6, 0.6), (-0.6, 0.6)])


def _draw(task, grid_size, rng, region=None, count=DRAWS):
    return [sample_scenario(task, rng, region, grid_size) for _ in range(count)]


def _evenly_spread(counts):
    """Pearson's statistic of equally likely classes, in standard deviations of its own law."""
    counts = np.asarray(counts, dtype=float)
    expected = counts.sum() / len(counts)
    statistic = ((counts - expected) ** 2 / expected).sum()
    freedom = len(counts) - 1
    return (statistic - freedom) / np.sqrt(2 * freedom)


def _assert_noise(noise, extent, uniform_gap):
    """Uniform within 0.05 P on each axis, the axes independent."""
    half = 0.05 * extent
    assert np.abs(noise).max() <= half
    for axis in (0, 1):
        assert uniform_gap(noise[:, axis], -half, half) < KS_BOUND
    assert abs(np.corrcoef(noise.T)[0, 1]) < 4.0 / np.sqrt(len(noise))


@pytest.mark.parametrize("n", SIZES)
def test_light_chase_placements(n, rng, uniform_gap):
    extent = playfield(n)
    scenarios = _draw("light_chase", n, rng)
    lights = np.array([s.light for s in scenarios])
    corner = np.linalg.norm(lights[:, None] - CORNERS * extent, axis=2).argmin(axis=1)
    assert all(s.start == (0.0, 0.0) for s in scenarios)
    assert all(s.walls is s.ball is s.target is None for s in scenarios)
    assert _evenly_spread(np.bincount(corner, minlength=4)) < 4.0
    _assert_noise(lights - CORNERS[corner] * extent, extent, uniform_gap)


@pytest.mark.parametrize("n", SIZES)
def test_carry_ball_placements(n, rng, uniform_gap):
    extent = playfield(n)
    scenarios = _draw("carry_ball", n, rng)
    starts, balls, targets = (
        np.array([getattr(s, name) for s in scenarios]) for name in ("start", "ball", "target")
    )
    assert np.all(starts[:, 1] == -0.85 * extent)
    assert uniform_gap(starts[:, 0], -0.6 * extent, 0.6 * extent) < KS_BOUND
    column = np.abs(balls[:, :1] - COLUMNS * extent).argmin(axis=1)
    offsets = np.stack([balls[:, 0] - COLUMNS[column] * extent, balls[:, 1]], axis=1)
    _assert_noise(offsets, extent, uniform_gap)
    goal = np.abs(targets[:, :1] - COLUMNS * extent).argmin(axis=1)
    assert np.allclose(targets[:, 0], COLUMNS[goal] * extent, rtol=0, atol=1e-12)
    assert np.allclose(targets[:, 1], 0.6 * extent, rtol=0, atol=1e-12)
    pairs = np.bincount(column * 4 + goal, minlength=16)
    assert _evenly_spread(pairs) < 4.0
    assert all(s.walls is s.light is None for s in scenarios)


@pytest.mark.parametrize("n", SIZES)
def test_obstacle_lights(n, rng, uniform_gap):
    extent = playfield(n)
    lights = np.array([s.light for s in _draw("obstacle", n, rng)])
    column = np.abs(lights[:, :1] - COLUMNS * extent).argmin(axis=1)
    assert _evenly_spread(np.bincount(column, minlength=4)) < 4.0
    centers = np.stack([COLUMNS[column] * extent, np.full(DRAWS, 0.6 * extent)], axis=1)
    _assert_noise(lights - centers, extent, uniform_gap)


@pytest.mark.parametrize("n", SIZES)
def test_obstacle_walls(n, rng, uniform_gap):
    extent = playfield(n)
    walls = [s.walls for s in _draw("obstacle", n, rng)]
    tops = np.array([[line[-1] for line in pair] for pair in walls])
    assert np.allclose(tops[..., 1], 1.2 * n, rtol=0, atol=1e-9)
    assert np.allclose(tops[:, 1, 0] - tops[:, 0, 0], 1.4 * n, rtol=0, atol=1e-9)
    passage = tops[..., 0].mean(axis=1)
    assert uniform_gap(passage, -0.8 * extent, 0.8 * extent) < KS_BOUND

    counts = np.array([[len(line) for line in pair] for pair in walls])
    assert (counts.min(), counts.max()) == (5, 19)
    for side in (0, 1):
        assert _evenly_spread(np.bincount(counts[:, side] - 5, minlength=15)) < 4.0
    assert abs(np.corrcoef(counts.T)[0, 1]) < 4.0 / np.sqrt(DRAWS)

    for side, sign in ((0, -1.0), (1, 1.0)):
        bottom = np.array([sign * 1.1 * extent, -1.1 * extent])
        moved, first = [], []
        for pair in walls:
            line = np.array(pair[side])
            even = bottom + np.linspace(0.0, 1.0, len(line))[:, None] * (line[-1] - bottom)
            assert np.allclose(line[-2:], even[-2:], rtol=0, atol=1e-9)
            moved.append(line[:-2] - even[:-2])
            first.append(moved[-1][0])
        for noise in (np.concatenate(moved), np.array(first)):
            assert np.abs(noise).max() <= 0.8 * n
            for axis in (0, 1):
                assert uniform_gap(noise[:, axis], -0.8 * n, 0.8 * n) < KS_BOUND


def _innermost(line, low, high, sign):
    """Innermost x of a wall between two heights: the extreme of its clipped segments."""
    reach = []
    for (x0, y0), (x1, y1) in itertools.pairwise(line):
        bottom, top = max(min(y0, y1), low), min(max(y0, y1), high)
        if bottom <= top:
            reach += [x0 + (x1 - x0) * (y - y0) / (y1 - y0) for y in (bottom, top)]
    return -sign * max(-sign * x for x in reach)


@pytest.mark.parametrize("n", SIZES)
def test_obstacle_starts_are_uniform_over_what_the_walls_leave(n, rng, uniform_gap):
    extent = playfield(n)
    shares, narrowed = [], 0
    for scenario in _draw("obstacle", n, rng):
        x, y = scenario.start
        assert y == -0.85 * extent
        left, right = scenario.walls
        low = max(_innermost(left, y - n, y + n, -1.0) + n, -0.6 * extent)
        high = min(_innermost(right, y - n, y + n, 1.0) - n, 0.6 * extent)
        narrowed += low > -0.6 * extent or high < 0.6 * extent
        shares.append((x - low) / (high - low))
    assert min(shares) >= 0.0
    assert max(shares) <= 1.0
    assert narrowed > DRAWS // 20
    assert uniform_gap(shares, 0.0, 1.0) < KS_BOUND


@pytest.mark.parametrize("task", TASKS)
def test_a_region_pins_the_light_or_ball(task, rng):
    extent = playfield(5)
    for region in range(4):
        for scenario in _draw(task, 5, rng, region, 50):
            x, y = scenario.ball if scenario.light is None else scenario.light
            expected = CORNERS[region] if task == "light_chase" else (COLUMNS[region], None)
            assert abs(x - expected[0] * extent) <= 0.05 * extent
            if expected[1] is not None:
                assert abs(y - expected[1] * extent) <= 0.05 * extent


@pytest.mark.parametrize("region", [-1, 4, 1.0, True, "0"])
def test_unknown_regions_are_refused(region, rng):
    with pytest.raises(ScenarioError, match="region must be an integer from 0 to 3"):
        sample_scenario("light_chase", rng, region)


def test_an_unknown_task_is_refused(rng):
    with pytest.raises(TaskError, match="Unknown task"):
        sample_scenario("chase", rng)


@pytest.mark.parametrize("task", TASKS)
def test_an_evaluations_scenarios(task):
    twelve = sample_scenarios(task, 7)
    assert len(twelve) == 12
    assert twelve == sample_scenarios(task, 7)
    assert twelve[:5] == sample_scenarios(task, 7, n=5)
    assert twelve != sample_scenarios(task, 8)
    goals = [s.ball if s.light is None else s.light for s in twelve]
    for i in range(12):
        offsets = np.abs(np.subtract(goals[i], goals[i % 4]))
        assert offsets.max() <= 0.1 * playfield(5)
    assert len(set(goals)) == 12


def test_a_seed_sequence_is_not_used_up():
    root = np.random.SeedSequence(3, spawn_key=(1, 2))
    first = sample_scenarios("obstacle", root, n=3)
    root.spawn(4)
    assert sample_scenarios("obstacle", root, n=3) == first


@pytest.mark.parametrize("n", [0, -1, 2.0, True])
def test_a_bad_number_of_runs_is_refused(n):
    with pytest.raises(ScenarioError, match="n must be a positive integer"):
        sample_scenarios("light_chase", 0, n=n)


def test_a_scenario_is_frozen_and_holds_plain_floats():
    scenario = Scenario(start=np.zeros(2), light=[np.float32(1.5), 2])
    assert scenario == Scenario(start=(0.0, 0.0), light=(1.5, 2.0))
    assert all(type(x) is float for x in (*scenario.start, *scenario.light))
    with pytest.raises(dataclasses.FrozenInstanceError):
        scenario.light = (0.0, 0.0)
    assert pickle.loads(pickle.dumps(scenario)) == scenario


def test_a_variant_is_validated_like_any_other():
    scenario = Scenario(start=(0.0, 0.0), light=(1.0, 2.0))
    assert dataclasses.replace(scenario, light=(20.0, 30.0)).light == (20.0, 30.0)
    with pytest.raises(ScenarioError, match="light must be finite"):
        dataclasses.replace(scenario, light=(np.nan, 0.0))


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"start": (0.0,)}, "start must be a pair"),
        ({"start": None}, "start must be a pair"),
        ({"start": "ab"}, "start must be a pair"),
        ({"start": (0.0, np.inf)}, "start must be finite"),
        ({"start": (0, 0), "ball": 3}, "ball must be a pair"),
        ({"start": (0, 0), "walls": 3}, "walls must be two lines"),
        ({"start": (0, 0), "walls": ([(0, 0), (1, 1)],)}, "walls must be two lines"),
        ({"start": (0, 0), "walls": ([(0, 0), (1, 1)], [(0, 0)])}, "at least 2 points"),
        ({"start": (0, 0), "walls": ([(0, 0), (1, np.nan)], [])}, "left wall point must be finite"),
    ],
)
def test_malformed_scenarios_are_refused(fields, message):
    with pytest.raises(ScenarioError, match=message):
        Scenario(**fields)


def test_a_scenario_must_fit_its_task_and_playfield(rng):
    chase = sample_scenario("light_chase", rng)
    chase.check(TASKS["light_chase"], 5)
    with pytest.raises(ScenarioError, match="must have ball"):
        dataclasses.replace(chase, light=None).check(TASKS["carry_ball"], 5)
    with pytest.raises(ScenarioError, match="must have walls"):
        chase.check(TASKS["obstacle"], 5)
    with pytest.raises(ScenarioError, match="must not have target"):
        dataclasses.replace(chase, target=(0, 0)).check(TASKS["light_chase"], 5)
    far = dataclasses.replace(chase, light=(55.0, 0.0))
    far.check(TASKS["light_chase"], 5)
    with pytest.raises(ScenarioError, match=r"light must lie in the playfield, -50 to 50"):
        far.check(TASKS["light_chase"], 3)


def test_wall_quads_lie_between_the_line_and_the_outside(rng):
    scenario = sample_scenario("obstacle", rng)
    quads = wall_quads(scenario, 5)
    left, right = scenario.walls
    assert quads.shape == (len(left) + len(right) - 2, 4, 2)
    assert quads[0].tolist() == [[-66.0, left[0][1]], [*left[0]], [*left[1]], [-66.0, left[1][1]]]
    last = quads[-1].tolist()
    assert last == [[66.0, right[-2][1]], [*right[-2]], [*right[-1]], [66.0, right[-1][1]]]
    assert wall_quads(Scenario(start=(0, 0), light=(1, 1)), 5).shape == (0, 4, 2)


@pytest.mark.parametrize(
    ("task", "changes", "message"),
    [
        ("light_chase", {"light": (4.0, 0.0)}, "light at .* overlaps the robot's grid"),
        ("carry_ball", {"ball": (0.0, -48.0)}, "ball at .* overlaps the robot's grid"),
        ("obstacle", {"start": (-58.0, -51.0)}, "A wall overlaps the robot's grid"),
        ("obstacle", {"start": (58.0, -51.0)}, "A wall overlaps the robot's grid"),
        ("obstacle", {"walls": (((-66.0, -66.0), (-1e4, 6.0)), ((66.0, -66.0), (5.0, 6.0)))},
         "Points of walls must lie within -120 to 120"),
    ],
)  # fmt: skip
def test_what_overlaps_the_robot_at_the_start_is_refused(task, changes, message):
    if task == "carry_ball":
        changes = {**changes, "start": (0.0, -51.0)}
    scenario = dataclasses.replace(sample_scenarios(task, 0)[0], **changes)
    with pytest.raises(ScenarioError, match=message):
        scenario.check(get_task(task), 5)


@pytest.mark.parametrize("size", [3, 5, 9, 15])
@pytest.mark.parametrize("task", sorted(TASKS))
def test_sampled_scenarios_never_overlap(task, size):
    for scenario in sample_scenarios(task, 3, 200, size, noise=MAX_NOISE):
        scenario.check(get_task(task), size)


def test_walls_overlap_where_the_quads_do():
    generator = np.random.default_rng(2)
    agreements = {True: 0, False: 0}
    for scenario in sample_scenarios("obstacle", 5, 100):
        for x in generator.uniform(-60.0, 60.0, 5):
            moved = dataclasses.replace(scenario, start=(float(x), -51.0))
            expected = square_overlaps(moved.start, 5.0, wall_quads(moved, 5))
            try:
                moved.check(get_task("obstacle"), 5)
                found = False
            except ScenarioError:
                found = True
            assert found == expected, moved
            agreements[found] += 1
    assert min(agreements.values()) > 20


@pytest.mark.parametrize("seed", [None, True, 1.5, "x", -1])
def test_seeds_that_would_not_repeat_are_refused(seed):
    with pytest.raises(ScenarioError, match="seed must be a non-negative integer"):
        sample_scenarios("light_chase", seed)
