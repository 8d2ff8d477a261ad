"""Optimizers and archives in any order of calls: the same state gives the same future."""

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    precondition,
    rule,
    run_state_machine_as_test,
)

from ncrs.evolution.optimizers import OPTIMIZERS, OptimizerError, make_optimizer
from tests.evolution.optimizers.measure_problem import DIMENSION, fitness, make_archive, measures
from tests.properties.attempts import few_examples

SMALL = {"population": 6, "sigma": 0.3}
EMITTERS = {**SMALL, "emitters": 2, "patience": 1}
SETTINGS = {
    "cma_es": {**SMALL, "parents": None}, "sep_cma_es": {**SMALL, "parents": None},
    "iso_cma_es": {**SMALL, "parents": None}, "cma_me": EMITTERS,
    "cma_mae": EMITTERS, "map_elites": {"population": 6, "initial_genomes": 6},
}  # fmt: skip


class Calls(RuleBasedStateMachine):
    """One optimizer is called in any order; at any time a copy from its state does the same."""

    name = ""

    def make(self, seed):
        own = OPTIMIZERS[self.name].settings(**SETTINGS[self.name])
        made = make_optimizer(own, DIMENSION, np.random.SeedSequence(seed))
        archive = make_archive()
        made.attach(archive)
        return made, archive

    @initialize(seed=st.integers(0, 3))
    def start(self, seed):
        self.seed = seed
        self.optimizer, self.archive = self.make(seed)
        self.asked = None

    @precondition(lambda self: self.asked is None)
    @rule()
    def ask(self):
        self.asked = self.optimizer.ask()
        assert self.asked.shape[1] == DIMENSION
        assert np.isfinite(self.asked).all()

    @precondition(lambda self: self.asked is not None)
    @rule()
    def ask_twice(self):
        with pytest.raises(OptimizerError):
            self.optimizer.ask()

    @precondition(lambda self: self.asked is None)
    @rule()
    def tell_too_early(self):
        with pytest.raises(OptimizerError):
            self.optimizer.tell(np.zeros(6))

    @precondition(lambda self: self.asked is not None)
    @rule(wrong=st.sampled_from(["inf", "nan", "short", "text"]))
    def tell_nonsense(self, wrong):
        count = len(self.asked)
        values = {
            "inf": np.full(count, np.inf), "nan": np.full(count, np.nan),
            "short": np.zeros(count - 1), "text": np.full(count, "x"),
        }  # fmt: skip
        with pytest.raises(OptimizerError):
            self.optimizer.tell(values[wrong])

    @precondition(lambda self: self.asked is not None)
    @rule(nans=st.integers(0, 2))
    def tell(self, nans):
        values = fitness(self.asked)
        values[:nans] = np.nan
        bodies = np.zeros((len(values), 4, 4), dtype=np.int8)
        added = self.archive.add(self.asked, values, measures(self.asked), bodies)
        self.optimizer.tell(values, added)
        self.asked = None

    @rule()
    def continue_from_the_state(self):
        state, archive_state = self.optimizer.state(), self.archive.state()
        other, archive = self.make(self.seed + 1)
        archive.load_state(archive_state)
        other.load_state(state)
        if self.asked is not None:
            np.testing.assert_array_equal(other.ask(), self.asked)
        self.optimizer, self.archive = other, archive


@pytest.mark.parametrize("name", SETTINGS)
def test_any_order_of_calls(name):
    machine = type(f"CallsOf_{name}", (Calls,), {"name": name})
    run_state_machine_as_test(machine, settings=settings(max_examples=few_examples()))
