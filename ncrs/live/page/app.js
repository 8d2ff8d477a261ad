// The page: which robot lives, how fast, and what hands and keys do to it.
"use strict";

(() => {
  const { element } = NCRSPage;
  const GROWTH_STEPS_PER_SECOND = 7;
  const REST_S = 0.7; // between growing and driving
  const MAX_STEPS = 12; // in one frame, so that a slow computer falls behind instead of freezing
  const $ = (id) => document.getElementById(id);

  const app = {
    content: null, robot: null, session: null, scenarioIndex: 0,
    isPlaying: true, speed: 1, tool: "lead", isFollowing: false, showsValues: false, isRepeating: true, isRepairing: false,
    isTouched: false, // true once hands have changed the course
    episodes: 0, successes: 0, arrows: "light",
    isCalm: matchMedia("(prefers-reduced-motion: reduce)").matches,
  };
  let stage, editor, hud, numbers, channels;
  let owed = 0, rest = 0, before = 0, previous = null, frames = 0;

  app.say = (text, isQuiet = false) => {
    $("status").textContent = text;
    if (isQuiet) return;
    $("toast").textContent = text;
    $("toast").hidden = false;
    clearTimeout(app.toastTimer);
    app.toastTimer = setTimeout(() => { $("toast").hidden = true; }, 3500);
  };
  function complain(error) {
    $("problem").textContent = error === null ? "" : error.message;
    $("problem").hidden = error === null;
  }

  // The body as characters, row by row from the front.
  app.characters = () => {
    const byCode = Object.fromEntries(Object.entries(app.session.world.cells).map(([c, cell]) => [cell.code, c]));
    return Array.from(app.session.body.data, (code) => byCode[code]).join("");
  };
  const current = () => ({ pose: [...app.session.center(), app.session.state.angle], ball: [app.session.state.ball_x, app.session.state.ball_y] });
  const isDriving = () => app.session.phase === "driving";
  // What is drawn lies between the last two steps, so that slow motion is smooth.
  function between(name) {
    const to = current()[name];
    if (previous === null || !isDriving()) return to;
    const part = Math.min(Math.max(owed, 0), 1);
    return to.map((value, i) => previous[name][i] + (value - previous[name][i]) * part);
  }
  app.pose = () => between("pose");
  app.ball = () => (isDriving() ? between("ball") : app.session.scenario.ball);

  function describe() {
    editor.describe();
    const { session, robot } = app, n = session.world.gridSize;
    $("stage").setAttribute("aria-label", `${robot.title} on the playfield of ${session.world.title}`);
    $("phase").textContent = {
      growing: session.growthStep === 0 ? "the seed" : `growth step ${session.growthStep} of ${session.world.growthSteps}`,
      driving: `${counted(n)}`,
      lost: "its state is no longer finite",
    }[session.phase];
  }
  function counted() {
    const cells = Object.values(app.session.world.cells);
    const of = (test) => app.session.body.data.filter((code) => test(cells.find((cell) => cell.code === code))).length;
    const words = [[of((cell) => cell.code !== 0), "cell"], [of((cell) => cell.senses), "sensor"], [of((cell) => cell.drives), "wheel"]];
    return words.map(([number, word]) => `${number} ${word}${number === 1 ? "" : "s"}`).join(", ");
  }

  function begin(session) {
    app.session = session;
    NCRSDrawing.world = session.world;
    owed = 0;
    rest = 0;
    previous = null;
    stage.forget();
    for (const part of [editor.fillPalette, hud.prepare, numbers.prepare, channels.prepare]) part();
    NCRSLive.showGenome($("genome"), app);
    app.fillSizes();
    app.showTools();
    describe();
  }
  function makeSession(robot, gridSize) {
    const known = app.content.worlds[robot.task][gridSize];
    return NCRSSession.make({ ...known, successRadius: robot.successRadius, distanceScore: robot.distanceScore }, robot.genome);
  }
  // Let a robot grow from its seed on a grid.
  function show(robot, gridSize = robot.gridSize, scenario = null) {
    complain(null);
    app.robot = robot;
    const session = makeSession(robot, gridSize);
    const { scenarios } = session.world;
    session.scenario = scenario ?? structuredClone(scenarios[app.scenarioIndex % scenarios.length]);
    begin(session);
    $("robot-title").textContent = robot.title;
    $("robot-note").textContent = `${session.world.title}. ${robot.note ?? ""}`;
    for (const button of $("robots").children) {
      const isChosen = button.robot === robot;
      button.setAttribute("aria-checked", isChosen);
      button.tabIndex = isChosen ? 0 : -1;
      if (isChosen) $("robots").scrollTo({ left: button.offsetLeft - $("robots").offsetLeft - 60, behavior: app.isCalm ? "instant" : "smooth" });
    }
    Object.assign(app, { episodes: 0, successes: 0, isTouched: scenario !== null });
    turn("isRepeating", "repeat", !robot.follows);
    play(true);
    document.body.dataset.robot = robot.id ?? "";
  }

  function drive() {
    if (app.session.drive()) {
      previous = null;
      owed = 0;
      stage.forget();
      stage.trace();
    } else {
      play(false);
      app.say("Nothing grew: paint a part into a cell, or grow from the seed.");
    }
    describe();
  }
  function growOn() {
    if (app.session.growthStep >= app.session.world.growthSteps) return drive();
    app.session.grow();
    if (app.session.phase === "lost") lose();
    return describe();
  }
  function lose() {
    play(false);
    app.say("The automaton's state is no longer finite: the weights of this genome are too large.");
    describe();
  }
  function driveOn() {
    previous = current();
    if (!app.session.advance()) return lose();
    stage.trace();
    const { session } = app;
    if (session.step === session.world.steps) {
      app.episodes += 1;
      app.successes += session.state.success ? 1 : 0;
    }
    return undefined;
  }
  function advance(seconds) {
    const { session } = app;
    if (session.phase === "growing") {
      const isComplete = session.growthStep >= session.world.growthSteps;
      rest += seconds * app.speed;
      if (rest < (isComplete || session.growthStep === 0 ? REST_S : 1 / GROWTH_STEPS_PER_SECOND)) return;
      rest = 0;
      growOn();
      return;
    }
    const isOver = () => app.isRepeating && session.step >= session.world.steps;
    if (isOver()) {
      rest += seconds * app.speed;
      if (rest > REST_S) repeat();
      return;
    }
    owed += (seconds * app.speed) / session.world.dt;
    for (let i = 0; owed >= 1 && i < MAX_STEPS && isDriving() && app.isPlaying && !isOver(); i++) {
      driveOn();
      owed -= 1;
    }
    owed = Math.min(owed, 1);
  }
  function draw(seconds) {
    stage.draw(seconds);
    if (frames % 2 === 0) {
      editor.draw();
      channels.draw();
    }
    hud.draw();
    numbers.draw();
  }
  function frame(now) {
    const seconds = Math.min(Math.max((now - before) / 1000, 0), 0.1);
    before = now;
    frames += 1;
    if (app.isPlaying) advance(seconds);
    draw(seconds);
    requestAnimationFrame(frame);
  }

  function play(isOn) {
    app.isPlaying = isOn;
    $("play").textContent = isOn ? "Pause" : "Play";
  }
  function step() {
    play(false);
    owed = 1;
    if (app.session.phase === "growing") growOn();
    else if (isDriving()) driveOn();
  }
  // Start the next episode: on the next course, or on this one if hands have changed it.
  function repeat() {
    rest = 0;
    if (app.isTouched) reset();
    else nextCourse();
  }
  function reset() {
    const { session } = app;
    if (session.phase === "growing" || session.phase === "lost") return show(app.robot, session.world.gridSize, session.scenario);
    previous = null;
    owed = 0;
    rest = 0;
    session.restart();
    stage.forget();
    stage.trace();
    play(true);
    return describe();
  }
  function nextCourse() {
    const { scenarios } = app.session.world;
    app.scenarioIndex = (app.scenarioIndex + 1) % scenarios.length;
    app.session.scenario = structuredClone(scenarios[app.scenarioIndex]);
    app.isTouched = false;
    if (app.session.phase !== "growing") reset();
    app.say(`Course ${app.scenarioIndex + 1} of ${scenarios.length}`, true);
  }
  function growAgain(isFromSeed) {
    const { session } = app;
    rest = 0;
    if (isFromSeed) session.seed();
    else session.startGrowing();
    stage.forget();
    play(true);
    describe();
  }
  function setSpeed(exponent) {
    app.speed = 2 ** exponent;
    $("speed").value = exponent;
    const text = exponent < 0 ? `1/${2 ** -exponent}` : String(app.speed);
    $("speed-value").textContent = `${text}×`;
    $("speed").setAttribute("aria-valuetext", `${text} times`);
  }
  // Set a switch of the page, and the button that shows it.
  function turn(name, id, isOn) {
    app[name] = isOn;
    $(id).setAttribute("aria-pressed", isOn);
  }

  app.changed = (text) => {
    previous = null;
    app.say(text, true);
    describe();
  };
  app.touched = () => $("hint").classList.add("is-gone");
  // Put the light, the ball or the target somewhere in the playfield.
  app.moveThing = (name, point) => {
    app.isTouched = true;
    const { session } = app, { extent } = session.world;
    const at = point.map((value) => Math.min(Math.max(value, -extent), extent));
    if (name === "ball") {
      if (isDriving()) {
        session.moveBall(at);
        previous = null;
      } else session.scenario.ball = at;
    } else session.scenario[name] = at;
    if (!isDriving()) return;
    session.place(session.scenario);
    session.sense();
  };
  app.addWall = (from, to) => {
    const refusal = NCRSLive.wallRefusal(app.session, from, to);
    if (refusal !== null) return app.say(refusal);
    return setWalls([...app.session.scenario.walls, NCRSLive.wallQuad(from, to)]);
  };
  app.eraseWall = (point) => {
    const { walls } = app.session.scenario;
    const found = walls.findLastIndex((quad) => NCRSLive.isInside(point, quad));
    if (found >= 0) setWalls(walls.filter((_, i) => i !== found));
  };
  function setWalls(walls) {
    app.isTouched = true;
    app.session.scenario.walls = walls;
    if (isDriving()) app.session.place(app.session.scenario);
  }

  Object.assign(app, {
    show, begin, makeSession, play, step, reset, nextCourse, growAgain, setSpeed, turn, complain, setWalls, advance,
    draw, isDriving,
  });

  async function start() {
    document.body.classList.toggle("is-framed", window.self !== window.top);
    app.content = await NCRSLive.load();
    const first = app.content.robots[0];
    NCRSDrawing.world = app.content.worlds[first.task][first.gridSize];
    stage = NCRSLive.makeStage($("stage"), app);
    editor = NCRSLive.makeEditor($("body"), $("palette"), app);
    hud = NCRSLive.makeHud($("hud"), app);
    numbers = NCRSLive.makeNumbers($("numbers"), app);
    channels = NCRSLive.makeChannels($("channels"), app);
    NCRSLive.addControls(app);
    NCRSLive.addChoice(app);
    setSpeed(0);
    if (!await app.follows(location.hash)) {
      const reason = $("problem").textContent; // of a link that could not be used
      show(first);
      if (reason) complain(new Error(reason));
    }
    before = performance.now();
    requestAnimationFrame(frame);
    document.body.dataset.ready = "true";
  }

  NCRSLive.app = app;
  start().catch(complain);
})();
