// A player of recorded episodes: play, pause, single steps, speed, scrubbing.
"use strict";

(() => {
  const { element } = NCRSReport;
  const SPEEDS = [0.1, 0.25, 0.5, 1, 2];

  // Values of the cells of one kind, spread over the grid.
  function spread(body, isKind, values, from) {
    const { cells } = NCRSReport.overview.world;
    const grid = new Array(body.length).fill(0);
    let next = from;
    for (let i = 0; i < body.length; i++) {
      if (cells[body[i]][isKind]) grid[i] = values[next++];
    }
    return grid;
  }

  function count(body, isKind) {
    const { cells } = NCRSReport.overview.world;
    return [...body].filter((character) => cells[character][isKind]).length;
  }

  // Everything to draw at a time, given in steps; poses between two steps are interpolated.
  function frameAt(body, episode, time) {
    const step = Math.floor(time), rest = time - step;
    const last = episode.angle.length - 1, next = Math.min(step + 1, last);
    const blend = (values, size, axis) => {
      const from = values[size * step + axis];
      return from + (values[size * next + axis] - from) * rest;
    };
    const turn = episode.angle[next] - episode.angle[step];
    const shortest = Math.atan2(Math.sin(turn), Math.cos(turn));
    const pose = [blend(episode.position, 2, 0), blend(episode.position, 2, 1),
      episode.angle[step] + shortest * rest];
    const path = [];
    for (let i = 0; i <= step; i++) path.push([episode.position[2 * i], episode.position[2 * i + 1]]);
    path.push([pose[0], pose[1]]);
    return {
      step, pose, path,
      ball: episode.ball && [blend(episode.ball, 2, 0), blend(episode.ball, 2, 1)],
      values: spread(body, "senses", episode.sensors, step * count(body, "senses")),
      gas: spread(body, "drives", episode.gas, step * count(body, "drives")),
    };
  }

  function distanceText(scenario, frame, episode) {
    const between = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]).toFixed(1);
    const at = (values) => [values[2 * frame.step], values[2 * frame.step + 1]];
    const robot = at(episode.position);
    const { extent, wallExtent } = NCRSReport.overview.world;
    const isOutside = Math.max(...robot.map(Math.abs)) > wallExtent * extent;
    return distances(scenario, robot, at, episode, between) + (isOutside ? ", outside the picture" : "");
  }

  function distances(scenario, robot, at, episode, between) {
    if (!episode.ball) return `${between(robot, scenario.light)} units from the light`;
    const ball = at(episode.ball);
    return `${between(robot, ball)} units from the ball, ball ${between(ball, scenario.target)} from the target`;
  }

  // A player for one robot; onEpisode is called with each episode that is chosen.
  NCRSReport.makePlayer = (robot, body, episodes, onEpisode) => {
    const name = NCRSReport.robotName(robot);
    const world = NCRSReport.overview.world;
    const steps = world.steps;
    let chosen = 0, time = 0, request = 0, before = null;

    const stage = element("canvas", { class: "stage", role: "img" });
    const closeUp = element("canvas", { class: "close-up", role: "img",
      "aria-label": "Close-up of the robot with sensor values and gas" });
    const scrubber = element("input", { type: "range", min: 0, max: steps, step: 1, value: 0,
      class: "scrubber", "aria-label": `Step of the episode, ${name}`, oninput: () => seek(Number(scrubber.value)) });
    const play = element("button", { type: "button", class: "main play", onclick: () => (request ? pause() : start()) }, "Play");
    const speed = element("select", { "aria-label": "Speed" },
      ...SPEEDS.map((value) => element("option", { value, selected: value === 0.5 }, `${value}×`)));
    const episode = element("select", { class: "episode", onchange: () => choose(Number(episode.value)) },
      ...episodes.map((_, i) => element("option", { value: i }, `Episode ${i + 1}`)));
    episode.setAttribute("aria-label", "Episode");
    const outcome = element("p", { class: "quiet outcome" });
    const readout = element("p", { class: "readout" });
    const step = (by, text, label) => element("button", { type: "button", "aria-label": label,
      onclick: () => { pause(); seek(Math.floor(time) + by); } }, text);

    function draw() {
      const current = episodes[chosen], scenario = world.scenarios[chosen];
      const frame = frameAt(body, current, time);
      NCRSReport.drawEpisode(stage, body, scenario, frame);
      NCRSReport.drawBody(closeUp, body, frame.values, frame.gas, true);
      scrubber.value = frame.step;
      const seconds = (frame.step * world.dt).toFixed(2);
      scrubber.setAttribute("aria-valuetext", `step ${frame.step} of ${steps}`);
      readout.textContent = `Step ${frame.step} of ${steps}, ${seconds}\u00a0s: ` +
        `reward ${current.reward[frame.step].toFixed(3)}, ${distanceText(scenario, frame, current)}.`;
    }
    function seek(to) {
      time = Math.min(Math.max(to, 0), steps);
      draw();
    }
    function tick(now) {
      const passed = before === null ? 0 : now - before; // a first frame's time may lie before the click
      before = now;
      time = Math.min(time + (passed / 1000 / world.dt) * Number(speed.value), steps);
      draw();
      if (time >= steps || !stage.isConnected) pause();
      else request = requestAnimationFrame(tick);
    }
    function start() {
      if (request) return;
      if (time >= steps) time = 0;
      before = null;
      play.textContent = "Pause";
      request = requestAnimationFrame(tick);
    }
    function pause() {
      cancelAnimationFrame(request);
      request = 0;
      play.textContent = "Play";
    }
    function choose(index) {
      pause();
      chosen = index;
      const { fitness, successStep } = episodes[index];
      const result = successStep < 0 ? "no success" : `success at step ${successStep}`;
      outcome.textContent = `Fitness in this episode ${fitness.toFixed(4)}, ${result}.`;
      stage.setAttribute("aria-label", `Episode ${index + 1} seen from above: ${outcome.textContent}`);
      onEpisode(episodes[index], index);
      seek(0);
    }

    const box = element("div", { class: "player" },
      element("div", { class: "player-head" }, element("h4", {}, "Episodes"), episode),
      stage,
      element("div", { class: "controls" }, play, NCRSReport.makeLiveButton(robot, () => chosen), step(-1, "‹", "One step back"), step(1, "›", "One step on"),
        speed),
      scrubber,
      element("div", { class: "below" }, closeUp, element("div", {}, readout, outcome)));
    return { box, start, pause, seek, draw, open: () => choose(0) };
  };
})();
