// One live robot: it grows, drives, loses and gains cells. All rules are the translated engine's.
"use strict";

const NCRSSession = (() => {
  const E = NCRSEngine;
  const EMPTY = 0;
  const many = (count, make) => Array.from({ length: count }, make);
  const BALL_MOTION = ["ball_vx", "ball_vy", "ball_omega"];

  // A session for a world, as ncrs/live/world.py describes it, and a genome of its task.
  function make(world, genome) {
    const n = world.gridSize, places = n * n;
    const channels = world.channels.length;
    const codes = Int8Array.from(world.partCodes);
    const networks = { growth: E.pack_growth(genome, channels), control: E.pack_control(genome, channels) };
    const grid = E.link_grid(n, channels);
    const session = {
      world, genome,
      body: E.newGrid(Int8Array, [n, n]),
      grown: E.seed_lanes(n),
      growthStep: 0,
      phase: "growing", // then "driving", or "lost" once a state is not finite
      brain: null,
      state: E.makeState(),
      sensed: E.newGrid(Float32Array, [1, places]),
      gas: new Float32Array(places),
      step: 0, reward: 0, total: 0, fitness: null, successStep: -1,
      repairSteps: 0, resting: 0, // steps of growth after a cut, none for 0; physics steps until they are done
      scenario: null, // start, light or ball, target, walls: quads of corners
    };
    let spare = E.seed_lanes(n);
    const physics = {
      settings: Object.assign(E.makeSettings(), {
        extent: world.extent, success_radius: world.successRadius,
        inverse_square: world.distanceScore === "inverse_square", has_ball: world.hasBall,
      }),
      robot: E.makeRobot(), wheels: many(places, E.makeWheel), sensors: many(places, E.makeSensor),
      exposed: many(places, E.makePoint), scenario: E.makeScenario(), quads: [],
      contacts: many(world.contactCapacity, E.makeContact), corners: many(4, E.makePoint),
    };

    function seed() {
      session.grown = E.seed_lanes(n);
      spare = E.seed_lanes(n);
      startGrowing();
    }
    function startGrowing() {
      session.growthStep = 0;
      session.phase = "growing";
      E.read_grown(session.grown, codes, session.body);
    }
    // One step of growth; returns true once it is complete.
    function grow() {
      const isFinite = E.growth_step(networks.growth, grid, channels, session.grown, spare);
      [session.grown, spare] = [spare, session.grown];
      session.growthStep += 1;
      if (!isFinite) session.phase = "lost";
      else E.read_grown(session.grown, codes, session.body);
      return !isFinite || session.growthStep >= world.growthSteps;
    }
    // Put the automaton into the body's cells, and the robot at the start; false for an empty body.
    function drive() {
      if (!setBody(session.body.data)) return false;
      session.phase = "driving";
      restart();
      return true;
    }
    function setBody(cells) {
      if (cells.every((code) => code === EMPTY)) return false;
      session.body.data.set(cells);
      E.prepare_robot(session.body, physics.robot, physics.wheels, physics.sensors, physics.exposed);
      session.brain = E.make_brain(networks.control, codes, session.body);
      return true;
    }
    function restart() {
      session.brain.states.data.fill(0);
      place(session.scenario);
      E.reset_episode(physics, session.state, session.sensed.data);
      session.gas.fill(0);
      Object.assign(session, { step: 0, reward: 0, total: 0, fitness: null, successStep: -1, resting: 0 });
    }
    // Use a scenario from now on; the robot stays where it is.
    function place(scenario) {
      session.scenario = scenario;
      const goal = scenario.light ?? scenario.ball;
      const [target_x, target_y] = scenario.target ?? [NaN, NaN];
      const walls = scenario.walls;
      const corners = E.newGrid(Float64Array, [Math.max(walls.length, 1), 4, 2]);
      corners.data.set(walls.flat(2));
      while (physics.quads.length < walls.length) physics.quads.push(E.makeQuad());
      Object.assign(physics.scenario, {
        start_x: scenario.start[0], start_y: scenario.start[1], goal_x: goal[0], goal_y: goal[1],
        target_x, target_y, quad_count: walls.length ? E.prepare_walls(corners, physics.quads) : 0,
      });
      session.state.clearance = 0;
      session.state.memory_count = 0;
    }
    function sense() {
      session.sensed.data.fill(0);
      E.sense(physics, session.state, session.sensed.data);
    }
    // One control step; false once the automaton's states are no longer finite.
    function step() {
      const reward = session.resting > 0 ? roll()
        : E.live_step(physics, session.state, session.brain, session.sensed, session.gas);
      if (!Number.isFinite(reward)) {
        session.phase = "lost";
        return false;
      }
      session.step += 1;
      session.reward = reward;
      session.total += reward;
      if (session.step === world.steps) session.fitness = session.total / world.steps;
      if (session.state.success && session.successStep < 0) session.successStep = session.step;
      return true;
    }
    // Make a cell empty or another part, in the growing body or in the driving one.
    function setCell(index, code) {
      return setCells([index], code);
    }
    // The same for several cells at once; cutting some off is the damage of training. A robot that
    // repairs itself rolls on without thrust, then goes on with what has grown back.
    function setCells(indices, code) {
      for (const index of indices) E.set_growing_cell(session.grown, index, code === EMPTY ? -1 : codes.indexOf(code));
      const cells = session.body.data.slice();
      for (const index of indices) cells[index] = code;
      if (session.phase === "growing") {
        session.body.data.set(cells);
        return true;
      }
      if (!exchange(cells)) return false;
      if (code === EMPTY) session.resting = Math.ceil(session.repairSteps / world.growthPerStep);
      return true;
    }
    // Go on in another body, in which cells that both have keep their states.
    function exchange(cells) {
      const { brain } = session, before = Object.assign(E.makeRobot(), physics.robot);
      const changed = cells.map((code, i) => code !== session.body.data[i]);
      if (!setBody(cells)) return false;
      E.inherit_states(brain, session.brain);
      E.exchange_robot(before, physics.robot, session.state);
      changed.forEach((isChanged, i) => { if (isChanged) session.gas[i] = 0; });
      sense();
      return true;
    }
    // One physics step of a robot that repairs itself, and its new body at the end.
    function roll() {
      session.gas.fill(0);
      const reward = E.step_episode(physics, session.state, session.gas, session.sensed.data.subarray(0, places));
      session.resting -= 1;
      if (session.resting > 0) return reward;
      const grown = E.newGrid(Int8Array, [n, n]);
      E.regrow(networks.growth, codes, session.repairSteps, session.body, grown);
      if (grown.data.some((code, i) => code !== session.body.data[i])) exchange(grown.data);
      return reward;
    }
    function center() {
      return E.grid_center(physics.robot, session.state);
    }
    function moveBall([x, y]) {
      for (const name of BALL_MOTION) session.state[name] = 0;
      Object.assign(session.state, { ball_x: x, ball_y: y });
    }
    // All channels of all cells, channels first, as the automaton sees them now.
    function channelMaps() {
      const maps = new Float32Array(channels * places);
      const lanes = session.grown.shape[2];
      const isDriving = session.phase !== "growing" && session.brain !== null;
      const fixed = channels - world.changingChannels;
      for (let i = 0; i < places; i++) {
        if (!isDriving) {
          for (let c = 0; c < channels; c++) maps[c * places + i] = session.grown.data[i * lanes + c];
          continue;
        }
        const code = session.body.data[i];
        maps[places + i] = 1;
        if (code === EMPTY) continue;
        maps[i] = 1;
        maps[(2 + codes.indexOf(code)) * places + i] = 1;
        const { states, indices } = session.brain;
        for (let c = fixed; c < channels; c++) {
          maps[c * places + i] = states.data[indices[i] * states.shape[2] + c - fixed];
        }
      }
      return maps;
    }

    return Object.assign(session, {
      seed, startGrowing, grow, drive, setBody, restart, place, sense, setCell, setCells, center, moveBall,
      channelMaps, advance: step, distances: () => E.distances(physics, session.state),
    });
  }

  // A whole episode, for comparison with the engine that trains: the body that grows and every pose.
  function replay(world, genome, scenario) {
    const session = make(world, genome);
    session.scenario = scenario;
    while (!session.grow());
    const poses = [], balls = [];
    let firstTouch = -1;
    const note = () => {
      poses.push([...session.center(), session.state.angle]);
      balls.push([session.state.ball_x, session.state.ball_y]);
      if (session.state.touched && firstTouch < 0) firstTouch = session.step;
    };
    if (session.phase === "growing" && session.drive()) {
      note();
      session.repairSteps = scenario.repairSteps ?? 0;
      const loseIfDue = () => {
        if (session.step === scenario.damage?.step) session.setCells(scenario.damage.cells, EMPTY);
      };
      loseIfDue();
      while (session.step < world.steps && session.advance()) {
        note();
        loseIfDue();
      }
    }
    return {
      body: Array.from(session.body.data), poses, balls, firstTouch,
      fitness: session.fitness, success: session.state.success, crossed: session.state.crossed,
    };
  }

  return { make, replay };
})();
