// What the robot knows, does and is made of: numbers, channels, genome.
"use strict";

(() => {
  const { element } = NCRSPage;
  const HIDDEN_UNITS = 30;
  const percent = (fraction) => `${(100 * fraction).toFixed(fraction > 0 && fraction < 0.1 ? 1 : 0)} %`;

  // A list of names and values; the values are written through the returned map.
  function list(place, lines) {
    const values = {};
    place.replaceChildren(...Object.entries(lines).map(([field, name]) => {
      values[field] = element("dd", { "data-field": field });
      return element("div", {}, element("dt", {}, name), values[field]);
    }));
    return values;
  }
  function write(place, text) {
    if (place.textContent !== text) place.textContent = text;
  }

  NCRSLive.makeHud = (place, app) => {
    let values = null;
    function prepare() {
      const { hasBall } = app.session.world;
      values = list(place, { time: "Time", reward: "Reward", mean: "Mean", distance: hasBall ? "Ball to target" : "To the light",
        success: "Success", tries: "Succeeded" });
    }
    function draw() {
      const { session } = app, isDriving = session.phase !== "growing";
      const [toGoal, toTarget] = isDriving ? session.distances() : [NaN, NaN];
      const decisive = session.world.hasBall ? toTarget : toGoal;
      write(values.time, isDriving ? `${(session.step * session.world.dt).toFixed(1)} s` : "–");
      write(values.reward, isDriving && session.step ? session.reward.toFixed(3) : "–");
      write(values.mean, isDriving && session.step ? (session.total / session.step).toFixed(3) : "–");
      write(values.distance, isDriving ? decisive.toFixed(1) : "–");
      const isDone = isDriving && session.successStep >= 0;
      write(values.success, !isDriving ? "–" : !isDone ? "not yet" : `at ${(session.successStep * session.world.dt).toFixed(1)} s`);
      values.tries.parentElement.hidden = app.episodes === 0;
      write(values.tries, `${app.successes} of ${app.episodes}`);
      values.success.className = isDone ? "good" : "";
    }
    return { prepare, draw };
  };

  NCRSLive.makeNumbers = (place, app) => {
    let values = null;
    function prepare() {
      values = list(place, { fitness: `Mean reward of the first ${app.session.world.steps} steps`,
        published: "Fitness in its tests", success: "Success in its tests" });
      const { robot } = app;
      const isKnown = Number.isFinite(robot.fitness);
      const asTrained = robot.gridSize === app.session.world.gridSize ? "" : `, on ${robot.gridSize} × ${robot.gridSize}`;
      write(values.published, isKnown ? `${robot.fitness.toFixed(3)}${asTrained}` : "not measured");
      const of = robot.episodes ? ` of ${robot.episodes.toLocaleString("en")} episodes` : "";
      write(values.success, Number.isFinite(robot.success) ? `${percent(robot.success)}${of}` : "not measured");
    }
    function draw() {
      const { fitness, step, world } = app.session;
      write(values.fitness, fitness === null ? `after ${Math.max(world.steps - step, 0)} steps` : fitness.toFixed(3));
    }
    return { prepare, draw };
  };

  // All channels as small maps.
  NCRSLive.makeChannels = (place, app) => {
    let canvases = [];
    function prepare() {
      const { channels, signedLimit } = app.session.world;
      canvases = channels.map((name) => element("canvas", { role: "img", "aria-label": `Channel ${name}` }));
      const ramp = element("span");
      ramp.style.background = NCRSDrawing.ramp("signed");
      place.replaceChildren(
        element("h4", {}, "The automaton's channels"),
        element("div", { class: "channels" }, ...channels.map((name, i) => element("figure", { class: "channel" },
          canvases[i], element("figcaption", {}, name.replace("/", "/\u200b"))))),
        element("div", { class: "scale", "aria-hidden": "true" }, element("span", {}, `−${signedLimit} or less`), ramp,
          element("span", {}, `${signedLimit} or more`)));
    }
    function draw() {
      const maps = app.session.channelMaps(), size = app.session.body.data.length;
      canvases.forEach((canvas, i) => NCRSDrawing.drawChannel(canvas, maps.subarray(i * size, (i + 1) * size)));
    }
    return { prepare, draw };
  };

  // One layer of weights as a picture: width x height pixels, by a function of both.
  function picture(width, height, limit, weight, scale, caption) {
    const canvas = element("canvas", { width, height, role: "img", "aria-label": caption });
    canvas.style.width = `${width * scale}px`;
    canvas.style.height = `${height * scale}px`;
    const context = canvas.getContext("2d");
    for (let y = 0; y < height; y++) {
      for (let x = 0; x < width; x++) {
        const value = weight(x, y);
        if (value === null) continue;
        context.fillStyle = NCRSDrawing.signedColor((value / limit) * NCRSDrawing.world.signedLimit);
        context.fillRect(x, y, 1, 1);
      }
    }
    return element("figure", {}, canvas, element("figcaption", {}, caption));
  }

  // The whole genome: kernels of the first layer, then the second and the third, each unit's bias last.
  NCRSLive.showGenome = (place, app) => {
    const { genome } = app.session, C = app.session.world.channels.length, U = HIDDEN_UNITS;
    const bias1 = 9 * C * U, weight2 = bias1 + U, bias2 = weight2 + U * U, weight3 = bias2 + U, bias3 = weight3 + C * U;
    const sorted = Float32Array.from(genome, Math.abs).sort();
    const limit = sorted[Math.floor(0.98 * (sorted.length - 1))] || 1;
    const first = (x, y) => { // 3 x 3 kernels with a gap between them, a unit in each column
      const unit = Math.floor(x / 4), channel = Math.floor(y / 4);
      if (channel === C) return x % 4 === 1 && y % 4 === 1 ? genome[bias1 + unit] : null;
      if (x % 4 === 3 || y % 4 === 3) return null;
      return genome[9 * (unit * C + channel) + 3 * (y % 4) + (x % 4)];
    };
    const second = (x, y) => (y < U ? genome[weight2 + x * U + y] : y === U ? null : genome[bias2 + x]);
    const third = (x, y) => (y < U ? genome[weight3 + x * U + y] : y === U ? null : genome[bias3 + x]);
    place.replaceChildren(element("h4", {}, `Its genome: ${genome.length.toLocaleString("en")} weights`),
      element("div", { class: "genome-maps" },
        picture(4 * U - 1, 4 * C + 3, limit, first, 2, `3 × 3 neighbours, ${C} channels to ${U} units`),
        picture(U, U + 2, limit, second, 3, `${U} to ${U}`),
        picture(C, U + 2, limit, third, 3, `${U} to ${C}`)));
  };

  NCRSLive.percent = percent;
})();
