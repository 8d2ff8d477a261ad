"""Rollout with damage, failing wheels, noise and repair: one episode at a time.

Bodies differ between the episodes of a genome here, so that the automaton cannot be computed in
all of them at once, as ``rollout_kernels`` does. Without perturbations both give the same results,
bit by bit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import STATE_LIMIT, STEPS_PER_ACTION
from ncrs.engines.brain_kernels import Brain, inherit_states, lone_step, make_brain, regrow
from ncrs.engines.nca_kernels import (
    CHANGING_CHANNELS,
    FloatArray,
    IntArray,
    Network,
    network_of,
)
from ncrs.engines.rollout_kernels import (
    Outcomes,
    Rollout,
    Workspace,
    is_finite,
    read_wheels,
    record_progress,
    write_sensors,
)
from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.layout import Robot, Robots, Scenarios, State, Worlds
from ncrs_envs.batched.noise import normal_value
from ncrs_envs.batched.perturbations import (
    Perturbation,
    Perturbations,
    add_sensor_noise,
    exchange_robot,
    lose_cells,
    mark_failing,
    sense_anew,
)
from ncrs_envs.batched.robot import prepare_robot
from ncrs_envs.batched.simulate import reset_episode, step_episode, world_at
from ncrs_envs.noise import STATE_NOISE
from ncrs_envs.perturbations import GROWTH_PER_STEP

_LIMIT = np.float32(STATE_LIMIT)


class Perturbed(NamedTuple):
    """Inputs of a perturbed rollout, beside those of every rollout."""

    growth: Network
    """Weights for growth, ``(P, ...)``."""
    perturbations: Perturbations
    """``(P or 1, E)``."""
    recovered: NDArray[np.float64]
    """Output: fraction of the lost modules that are back at the end, ``(P, E)``; 1 if none was
    lost."""


class _Networks(NamedTuple):
    """One genome's weights."""

    control: Network
    growth: Network
    part_codes: NDArray[np.int8]


class _Bodies(NamedTuple):
    """Bodies of one episode, ``(n, n)``."""

    whole: NDArray[np.int8]
    """As it was grown."""
    present: NDArray[np.int8]
    hit: NDArray[np.int8]
    """What the damage struck."""
    damaged: NDArray[np.int8]
    """What the damage left."""
    following: NDArray[np.int8]
    """Body to continue with."""


class _Buffers(NamedTuple):
    """Arrays of one episode's steps."""

    observations: FloatArray
    """``(1, n * n)``."""
    action: FloatArray
    """``(n * n,)``."""
    fails: NDArray[np.bool_]
    """Wheels that fail, ``(n * n,)``."""


class _Trial(NamedTuple):
    """One episode."""

    episode: int
    """Index of its scenario."""
    steps: int
    state: State
    perturbation: Perturbation
    damaged: IntArray
    failing: IntArray


@kernel
def roll_out_perturbed(
    rollout: Rollout,
    perturbed: Perturbed,
    workspace: Workspace,
    genomes: IntArray,
    outcomes: Outcomes,
) -> None:
    """Drive the robots of the chosen genomes through their episodes.

    Args:
        rollout: Inputs of the rollout.
        perturbed: Perturbations, and what they need.
        workspace: Workspace of this call alone, with records of two robots.
        genomes: Indices of the genomes to roll out, whose bodies are valid.
        outcomes: Output.
    """
    places = rollout.bodies.shape[1] * rollout.bodies.shape[2]
    buffers = _Buffers(
        np.zeros((1, places), dtype=np.float32),
        np.zeros(places, dtype=np.float32),
        np.zeros(places, dtype=np.bool_),
    )
    listed = perturbed.perturbations
    for genome in genomes:
        body = rollout.bodies[genome]
        bodies = _Bodies(body, body.copy(), body.copy(), body.copy(), body.copy())
        networks = _Networks(
            network_of(rollout.networks, genome),
            network_of(perturbed.growth, genome),
            rollout.part_codes,
        )
        row = genome % len(rollout.scenarios.scenarios)
        scenarios = Scenarios(rollout.scenarios.scenarios[row], rollout.scenarios.quads[row])
        worlds = Worlds(rollout.settings, workspace.robots, scenarios, workspace.scratch)
        for episode in range(outcomes.success.shape[1]):
            state: State = workspace.states[0]
            trial = _Trial(
                episode,
                rollout.steps,
                state,
                listed.perturbations[row, episode],
                listed.damaged[row, episode],
                listed.failing[row, episode],
            )
            fitness = _drive(worlds, trial, bodies, networks, buffers)
            outcomes.episode_fitness[genome, episode] = fitness
            record_progress(outcomes, genome, episode, state)
            perturbed.recovered[genome, episode] = _recovered(bodies)


@kernel
def _drive(
    worlds: Worlds, trial: _Trial, bodies: _Bodies, networks: _Networks, buffers: _Buffers
) -> float:
    """Drive a robot through its episode and return the mean reward."""
    state = trial.state
    perturbation = trial.perturbation
    observation = buffers.observations[0]
    for array in (bodies.present, bodies.hit, bodies.damaged):
        array[:] = bodies.whole
    here = 0
    _prepare(worlds.robots, here, bodies.whole)
    mark_failing(bodies.whole, trial.failing, perturbation.failure_fraction, buffers.fails)
    brain = make_brain(networks.control, networks.part_codes, bodies.whole)
    reset_episode(world_at(worlds, here, trial.episode), state, observation)
    _add_noise(worlds, trial, here, 0, observation)
    total = 0.0
    resting = 0
    acted = 0
    is_repaired = False
    duration = -(-perturbation.repair_steps // GROWTH_PER_STEP)
    for step in range(trial.steps + 1):
        for is_damage in (True, False):
            if is_damage:
                if step != perturbation.damage_step:
                    continue
                fraction = perturbation.damage_fraction
                bodies.hit[:] = bodies.present
                lose_cells(bodies.present, trial.damaged, fraction, bodies.following)
                bodies.damaged[:] = bodies.following
                if perturbation.repair_every == 0:
                    resting = duration
            else:
                if not is_repaired:
                    continue
                is_repaired = False
                regrow(
                    networks.growth,
                    networks.part_codes,
                    perturbation.repair_steps,
                    bodies.present,
                    bodies.following,
                )
            if _are_equal(bodies.present, bodies.following):
                continue
            there = 1 - here
            _exchange(worlds, trial, bodies, there, observation)
            _add_noise(worlds, trial, there, step, observation)
            here = there
            after = make_brain(networks.control, networks.part_codes, bodies.present)
            inherit_states(brain, after)
            brain = after
        if step == trial.steps:
            break
        if perturbation.repair_steps > 0 and 0 < perturbation.repair_every <= acted:
            resting = duration
            acted = 0
        if resting > 0:
            resting -= 1
            is_repaired = resting == 0
            buffers.action[:] = 0.0
        else:
            acted += 1
            if not _act(worlds, trial, here, step, brain, buffers):
                total = np.nan
                break
        world = world_at(worlds, here, trial.episode)
        total += step_episode(world, state, buffers.action, observation)
        _add_noise(worlds, trial, here, step + 1, observation)
    return total / trial.steps if is_finite(brain.states, 0) else np.nan


@kernel
def _prepare(robots: Robots, index: int, body: NDArray[np.int8]) -> None:
    prepare_robot(
        body,
        robots.robots[index],
        robots.wheels[index],
        robots.sensors[index],
        robots.exposed[index],
    )


@kernel
def _are_equal(body: NDArray[np.int8], other: NDArray[np.int8]) -> bool:
    different = 0
    for place in range(body.size):
        if body.flat[place] != other.flat[place]:
            different += 1
    return different == 0


@kernel
def _exchange(
    worlds: Worlds, trial: _Trial, bodies: _Bodies, there: int, observation: FloatArray
) -> None:
    """Continue with the following body, whose records have the index ``there``."""
    _prepare(worlds.robots, there, bodies.following)
    before: Robot = worlds.robots.robots[1 - there]
    after: Robot = worlds.robots.robots[there]
    exchange_robot(before, after, trial.state)
    bodies.present[:] = bodies.following
    sensors = worlds.robots.sensors[1 - there, : before.sensor_count]
    sense_anew(sensors, world_at(worlds, there, trial.episode), trial.state, observation)


@kernel
def _add_noise(
    worlds: Worlds, trial: _Trial, here: int, step: int, observation: FloatArray
) -> None:
    if trial.perturbation.sensor_noise > 0.0:
        sensors = worlds.robots.sensors[here, : worlds.robots.robots[here].sensor_count]
        add_sensor_noise(sensors, trial.perturbation, step, observation)


@kernel
def _act(  # noqa: PLR0913 - one moment of an episode
    worlds: Worlds, trial: _Trial, here: int, step: int, brain: Brain, buffers: _Buffers
) -> bool:
    """Let the automaton act and return True if the gas of all wheels is finite."""
    current = brain.states
    updated = brain.updated
    sensors = worlds.robots.sensors[here, : worlds.robots.robots[here].sensor_count]
    wheels = worlds.robots.wheels[here, : worlds.robots.robots[here].wheel_count]
    for half in range(STEPS_PER_ACTION):
        write_sensors(sensors, brain.indices, buffers.observations, current)
        lone_step(brain, current, updated)
        if trial.perturbation.state_noise > 0.0:
            _add_state_noise(trial, brain.indices, STEPS_PER_ACTION * step + half, updated)
        current, updated = updated, current
    brain.states[:] = current
    finite = read_wheels(wheels, brain.indices, current, 0, buffers.action)
    if 0 <= trial.perturbation.failure_step <= step:
        for place in range(len(buffers.fails)):
            if buffers.fails[place]:
                buffers.action[place] = 0.0
    return finite


@kernel
def _add_state_noise(trial: _Trial, indices: IntArray, moment: int, states: FloatArray) -> None:
    """Add noise to the states after a step of control, whose number is ``moment``."""
    perturbation = trial.perturbation
    for place in range(len(indices)):
        if indices[place] < 0:
            continue
        for lane in range(CHANGING_CHANNELS):
            counter = (moment * len(indices) + place) * CHANGING_CHANNELS + lane
            drawn = normal_value(perturbation.seed, STATE_NOISE, counter)
            noise = np.float32(perturbation.state_noise * drawn)
            value = states[indices[place], 0, lane] + noise
            states[indices[place], 0, lane] = min(max(value, -_LIMIT), _LIMIT)


@kernel
def _recovered(bodies: _Bodies) -> float:
    """Return the fraction of the lost modules that are back; 1 if none was lost."""
    lost = 0
    back = 0
    for place in range(bodies.hit.size):
        code = bodies.hit.flat[place]
        if code != bodies.damaged.flat[place]:
            lost += 1
            if code == bodies.present.flat[place]:
                back += 1
    return back / lost if lost > 0 else 1.0
