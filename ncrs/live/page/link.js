// Links that hold the whole state of a robot and its playfield, to go on from there bit by bit.
"use strict";

(() => {
  const VERSION = 1;
  const COUNTERS = ["step", "reward", "total", "fitness", "successStep", "growthStep", "repairSteps", "resting", "phase"];
  const PHASES = ["growing", "driving"];
  const ODD = { NaN, Infinity, "-Infinity": -Infinity };
  const MAX_WALLS = 200;
  const FARTHEST = 1e4; // a coordinate in units
  const packed = (array) => NCRSLive.base64(new Uint8Array(array.buffer, array.byteOffset, array.byteLength));
  const refuse = (reason) => { throw new Error(`The link cannot be used: ${reason}.`); };

  function unpacked(text, Store, length) {
    const raw = typeof text === "string" ? NCRSLive.bytes(text) : refuse("a part of it is missing");
    if (raw.length !== length * Store.BYTES_PER_ELEMENT) refuse("a part of it has the wrong size");
    return new Store(raw.buffer);
  }

  // All that goes on: records hold numbers and truths alone, and memories of contacts.
  NCRSLive.snapshot = (app) => {
    const { session, robot } = app;
    const { genome, ...rest } = robot;
    return {
      version: VERSION,
      robot: robot.isOwn ? { ...rest, genome: packed(genome) } : { id: robot.id },
      gridSize: session.world.gridSize, scenario: session.scenario, body: Array.from(session.body.data),
      grown: packed(session.grown.data), brain: session.brain && packed(session.brain.states.data),
      sensed: packed(session.sensed.data), gas: packed(session.gas), state: session.state,
      counters: Object.fromEntries(COUNTERS.map((name) => [name, session[name]])), speed: app.speed,
      isRepeating: app.isRepeating,
    };
  };

  const isPoint = (value) => Array.isArray(value) && value.length === 2 && value.every((v) => Math.abs(v) < FARTHEST && typeof v === "number");
  function checkedScenario(value, world) {
    const wanted = world.hasBall ? ["start", "ball", "target"] : ["start", "light"];
    if (!value || !wanted.every((name) => isPoint(value[name]))) refuse("its course lacks a place");
    const walls = value.walls ?? [];
    const isWall = (quad) => Array.isArray(quad) && quad.length === 4 && quad.every(isPoint);
    if (!Array.isArray(walls) || walls.length > MAX_WALLS || !walls.every(isWall)) refuse("its walls are damaged");
    return { ...Object.fromEntries(wanted.map((name) => [name, value[name]])), walls };
  }
  // Copy a record's numbers and truths; distances that nothing has measured yet are infinite.
  function copyRecord(target, source) {
    for (const [name, value] of Object.entries(target)) {
      if (Array.isArray(value)) value.forEach((item, i) => copyRecord(item, source?.[name]?.[i]));
      else if (typeof source?.[name] !== typeof value) refuse("its state is damaged");
      else if (typeof value === "number" && !Number.isFinite(source[name]) && !name.startsWith("closest")) refuse("its state is damaged");
      else target[name] = source[name];
    }
  }

  // Continue from a snapshot in a new session of the same robot and grid size.
  NCRSLive.restore = (session, saved) => {
    const { world } = session, places = world.gridSize ** 2;
    session.scenario = checkedScenario(saved.scenario, world);
    if (saved.body === undefined) return; // a course alone: the robot grows in it
    const cells = Array.isArray(saved.body) ? saved.body : refuse("its body is missing");
    if (cells.length !== places || !cells.every((code) => code === 0 || world.partCodes.includes(code))) refuse("its body is damaged");
    session.grown.data.set(unpacked(saved.grown, Float32Array, session.grown.data.length));
    if (!session.grown.data.every(Number.isFinite) || !PHASES.includes(saved.counters?.phase)) refuse("its state is damaged");
    for (const name of COUNTERS) {
      const value = saved.counters[name];
      if (name !== "phase" && !(name === "fitness" && value === null) && !Number.isFinite(value)) refuse("its counters are damaged");
      session[name] = value;
    }
    if (session.phase === "growing") {
      session.body.data.set(cells);
      return;
    }
    if (!session.setBody(cells)) refuse("its body is empty");
    session.brain.states.data.set(unpacked(saved.brain, Float32Array, session.brain.states.data.length));
    session.place(session.scenario);
    copyRecord(session.state, saved.state);
    session.state.memory_count = Math.min(Math.max(Math.trunc(session.state.memory_count), 0), session.state.memories.length);
    session.sensed.data.set(unpacked(saved.sensed, Float32Array, places));
    session.gas.set(unpacked(saved.gas, Float32Array, places));
  };

  const toUrl = (text) => text.replace(/\+/g, "-").replace(/\//g, "_").replace(/=+$/, "");
  const fromUrl = (text) => text.replace(/-/g, "+").replace(/_/g, "/");

  NCRSLive.encode = async (snapshot) => {
    const text = JSON.stringify(snapshot, (_, value) => (typeof value === "number" && !Number.isFinite(value) ? { odd: String(value) } : value));
    return `#z=${toUrl(NCRSLive.base64(await NCRSLive.deflate(new TextEncoder().encode(text))))}`;
  };

  // The snapshot of an address: #z= is packed, #j= is plain, as reports write it; null if there is none.
  NCRSLive.decode = async (hash) => {
    const found = /^#([zj])=([\w-]+)$/.exec(hash);
    if (!found) return null;
    try {
      const raw = NCRSLive.bytes(fromUrl(found[2]));
      const text = new TextDecoder().decode(found[1] === "z" ? await NCRSLive.inflate(raw) : raw);
      const saved = JSON.parse(text, (_, value) => (value && typeof value.odd === "string" && Object.hasOwn(ODD, value.odd) ? ODD[value.odd] : value));
      if (saved?.version !== VERSION) refuse("it is of another version");
      return saved;
    } catch (error) {
      return refuse(error instanceof SyntaxError || error instanceof TypeError || error.name === "InvalidCharacterError" ? "it is not whole" : error.message.replace(/^.*used: |\.$/g, ""));
    }
  };

  // The robot that a snapshot names or holds.
  NCRSLive.robotOf = (saved, content) => {
    const wanted = saved.robot ?? {};
    if (wanted.genome === undefined) {
      return content.robots.find(({ id }) => id === wanted.id) ?? refuse("this page does not hold its robot");
    }
    const raw = typeof wanted.genome === "string" ? NCRSLive.bytes(wanted.genome) : refuse("its genome is damaged");
    if (raw.length % 4) refuse("its genome is damaged");
    const values = NCRSLive.weights(raw);
    try {
      return NCRSLive.checkRobot({ ...wanted, genome: { shape: [values.length], values } }, content.worlds, wanted.task);
    } catch (error) {
      return refuse(error.message);
    }
  };
})();
