"""Relays: the wiring, its mirror images, and its silence while a body grows."""

import numpy as np
import pytest

import ncrs
from ncrs.automaton.channels import nca_layout
from ncrs.automaton.nca import nca_of
from ncrs.automaton.relays import (
    BODIES,
    GAS_STEP,
    GATE_STEP,
    HIDDEN_CONTRAST_STEP,
    HIDDEN_STEP,
    PART_STEP,
    SENSED_CONTRAST_STEP,
    SENSED_STEP,
    RelayMap,
)
from ncrs_envs.body import parse_body
from ncrs_envs.mirroring import mirror_left_right
from ncrs_envs.scenario import sample_scenarios

LAYOUT = nca_layout("carry_ball")
GAS, HIDDEN = LAYOUT.io_channel, range(LAYOUT.part_channels.stop, LAYOUT.io_channel)
RELAYS = RelayMap(LAYOUT)
GRID = parse_body(BODIES["carry_ball"])
SENSED = np.where((GRID == 2) | (GRID == 3), 0.5, 0.0).astype(np.float32)
BODY = ncrs.grow_to(BODIES["carry_ball"], "carry_ball").astype(float)


def genomes(count: int, scale: float = 0.3, seed: int = 0) -> np.ndarray:
    """Genomes at random coordinates, in the body."""
    points = np.random.default_rng(seed).normal(scale=scale, size=(count, RELAYS.matrix.shape[1]))
    return (RELAYS.base + points @ RELAYS.matrix.T + BODY).astype(np.float32)


def controller_of(genome):
    """Controller of a genome in the body."""
    return ncrs.Controller(nca_of(genome.astype(np.float32), "carry_ball"), GRID)


def test_without_weights_every_wheel_has_full_gas():
    controller = controller_of(RELAYS.base + BODY)
    for _ in range(4):
        np.testing.assert_array_equal(controller.act(SENSED), np.where(GRID == 4, 1.0, 0.0))


@pytest.mark.parametrize("task", ["light_chase", "obstacle", "carry_ball", "obstacle_touch"])
def test_coordinates_are_independent(task):
    matrix = RelayMap(nca_layout(task)).matrix
    assert matrix.shape == {"carry_ball": (4873, 223)}.get(task, matrix.shape)
    assert np.linalg.matrix_rank(matrix) == matrix.shape[1]
    assert matrix.any(axis=0).all()


def test_steps_are_those_of_the_kinds():
    assert set(np.abs(RELAYS.matrix[RELAYS.matrix != 0])) == {
        SENSED_STEP, SENSED_CONTRAST_STEP, HIDDEN_STEP, HIDDEN_CONTRAST_STEP, GAS_STEP, PART_STEP,
        GATE_STEP,
    }  # fmt: skip


def test_left_and_right_are_treated_alike():
    """A mirrored course is driven in the mirror image, but for rounding, which can grow."""
    courses = sample_scenarios("carry_ball", 3, 6)
    mirrored = [mirror_left_right(course) for course in courses]
    found = genomes(8, 0.03)
    one, other = (
        ncrs.evaluate(found, "carry_ball", scenarios=both, engine="batched")
        for both in (courses, mirrored)
    )
    np.testing.assert_allclose(one.episode_fitness, other.episode_fitness, rtol=0, atol=2e-4)
    # They do not drive alike, and steer, so that this says something.
    assert one.episode_fitness.std(axis=0).min() > 4e-4


def test_silent_while_the_body_grows():
    result = ncrs.evaluate(genomes(64, 0.5), "carry_ball", episodes=1, engine="batched")
    np.testing.assert_array_equal(result.bodies, np.broadcast_to(GRID, result.bodies.shape))


def test_a_difference_reaches_both_hidden_channels_with_opposite_signs():
    """The coordinate of the difference of two sensors beside a cell, found by what it does."""
    first, second = HIDDEN[0], HIDDEN[1]
    reading = LAYOUT.layers(RELAYS.matrix.T)[0]
    wanted = np.flatnonzero(
        (reading[:, :, GAS, 1, 2] == SENSED_CONTRAST_STEP).any(axis=1)
        & (reading[:, 1 : 1 + 4, GAS, 1, 2] != 0).any(axis=1)
    )
    assert wanted.size == 1
    sensed = SENSED.copy()
    sensed[3, 3] += 0.03
    controller = controller_of(RELAYS.base + RELAYS.matrix[:, wanted[0]] + BODY)
    controller.act(sensed)
    states = controller.states
    # Between the light sensors: their difference, times its step.
    np.testing.assert_allclose(states[3, 2, first], 0.03 * SENSED_CONTRAST_STEP, atol=1e-4)
    np.testing.assert_allclose(states[3, 2, second], -0.03 * SENSED_CONTRAST_STEP, atol=1e-4)


def test_coordinates_of_genomes():
    points = np.random.default_rng(1).normal(size=(3, RELAYS.matrix.shape[1]))
    for point in points:
        genome = (RELAYS.base + RELAYS.matrix @ point + BODY).astype(np.float32)
        found = RELAYS.coordinates_of(genome.astype(float))
        np.testing.assert_allclose(found, point, atol=1e-3)
    np.testing.assert_array_equal(RELAYS.coordinates_of(BODY), np.zeros(points.shape[1]))
    best = ncrs.load_champion("carry_ball/cma_es").genome
    assert RELAYS.coordinates_of(best.astype(float)) is None
