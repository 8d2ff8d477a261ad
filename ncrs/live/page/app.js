// The page: which robot lives, how fast, and what hands and keys do to it.
"use strict";

(() => {
  const { element } = NCRSPage;
  const GROWTH_STEPS_PER_SECOND = 7;
  const REST_S = 0.7; // between growing and driving
  const MAX_STEPS = 12; // in one frame, so that a slow computer falls behind instead of freezing
  const TOOLS = [["lead", "Lead"], ["wall", "Wall"], ["erase", "Erase"]];
  const $ = (id) => document.getElementById(id);

  const app = {
    content: null, robot: null, session: null, scenarioIndex: 0,
    isPlaying: true, speed: 1, tool: "lead", isFollowing: false, arrows: "light",
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
    fillSizes();
    showTools();
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
    }
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
    if (app.session.successStep === app.session.step) app.say("Success!");
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
    owed += (seconds * app.speed) / session.world.dt;
    for (let i = 0; owed >= 1 && i < MAX_STEPS && isDriving() && app.isPlaying; i++) {
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
  function reset() {
    const { session } = app;
    if (session.phase === "growing" || session.phase === "lost") return show(app.robot, session.world.gridSize, session.scenario);
    previous = null;
    owed = 0;
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
  function follow(isOn) {
    app.isFollowing = isOn;
    $("follow").setAttribute("aria-pressed", isOn);
    $("follow").classList.toggle("main", isOn);
  }

  app.changed = (text) => {
    previous = null;
    app.say(text, true);
    describe();
  };
  app.touched = () => $("hint").classList.add("is-gone");
  // Put the light, the ball or the target somewhere in the playfield.
  app.moveThing = (name, point) => {
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
    app.session.scenario.walls = walls;
    if (isDriving()) app.session.place(app.session.scenario);
  }

  function radios(place, choices, isChosen, choose) {
    place.replaceChildren(...choices.map(([value, label]) => element("button", { type: "button", role: "radio",
      "aria-checked": isChosen(value), tabindex: isChosen(value) ? 0 : -1, "data-value": value, onclick: () => choose(value) }, label)));
  }
  // Arrow keys move within a group of choices, as in any group of radio buttons.
  function arrowKeys(place) {
    place.addEventListener("keydown", (event) => {
      const by = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
      const at = [...place.children].indexOf(event.target);
      if (by === undefined || at < 0) return;
      event.preventDefault();
      event.stopPropagation();
      place.children[(at + by + place.children.length) % place.children.length].click();
      place.querySelector('[aria-checked="true"]').focus();
    });
  }
  function showTools() {
    const isFree = !app.session.world.hasBall;
    if (!isFree) app.tool = "lead";
    radios($("tools"), isFree ? TOOLS : TOOLS.slice(0, 1), (tool) => tool === app.tool, (tool) => { app.tool = tool; showTools(); });
    $("clear-walls").hidden = !isFree;
    app.arrows = isFree ? "light" : "target";
    $("hint").textContent = isFree ? "Drag the light: the robot follows it." : "Drag the ball or the target.";
  }
  function fillSizes() {
    const sizes = Object.keys(app.content.worlds[app.robot.task]).map(Number);
    radios($("sizes"), sizes.map((n) => [n, String(n)]), (n) => n === app.session.world.gridSize, (n) => show(app.robot, n));
  }
  function thumbnail(robot) {
    const canvas = element("canvas", { "aria-hidden": "true" });
    const world = app.content.worlds[robot.task][robot.gridSize];
    const known = Number.isFinite(robot.success) ? `${NCRSLive.percent(robot.success)} success` : "never tested";
    const button = element("button", { type: "button", role: "radio", "data-id": robot.id ?? "", onclick: () => show(robot) },
      canvas, element("b", {}, robot.title), element("span", {}, `${world.title}, ${known}`));
    button.robot = robot;
    requestAnimationFrame(() => {
      const shown = NCRSDrawing.world;
      NCRSDrawing.world = world;
      NCRSDrawing.drawBody(canvas, robot.body ?? ".".repeat(world.gridSize ** 2));
      NCRSDrawing.world = shown;
    });
    return button;
  }
  // Add a robot that a file or a link brought to those of the page; its body is what its genome grows.
  function adopt(robot) {
    const session = makeSession(robot, robot.gridSize);
    while (!session.grow());
    app.session = session;
    robot.body = app.characters();
    robot.note = "It was brought here, and is on no other page.";
    $("robots").prepend(thumbnail(robot));
    return robot;
  }
  async function open(file) {
    try {
      const before = app.session;
      const robot = await NCRSLive.readRobot(file, app.content.worlds, app.robot.task);
      app.session = before;
      show(adopt(robot));
      app.say(`${robot.title} is alive.`);
    } catch (error) {
      complain(error);
    }
  }
  async function share() {
    history.replaceState(null, "", await NCRSLive.encode(NCRSLive.snapshot(app)));
    try {
      await navigator.clipboard.writeText(location.href);
      app.say("The link is copied; it restores this very moment.");
    } catch {
      app.say("The address bar now holds the link; it restores this very moment.");
    }
  }
  // Show what an address holds, if anything.
  async function follows(hash) {
    try {
      const saved = await NCRSLive.decode(hash);
      if (saved === null) return false;
      let robot = NCRSLive.robotOf(saved, app.content);
      const size = saved.gridSize ?? robot.gridSize;
      if (!Object.hasOwn(app.content.worlds[robot.task], size)) throw new Error("The link cannot be used: its grid size is not of this page.");
      const session = makeSession(robot, size);
      NCRSLive.restore(session, saved);
      if (robot.isOwn) robot = adopt(robot);
      show(robot, size, session.scenario);
      if (saved.body !== undefined) {
        begin(session);
        play(false);
        setSpeed(Number.isFinite(saved.speed) ? Math.min(Math.max(Math.round(Math.log2(saved.speed)), -3), 2) : 0);
      }
      return true;
    } catch (error) {
      complain(error);
      return false;
    }
  }

  const KEYS = {
    " ": () => play(!app.isPlaying), ".": step, r: reset, n: nextCourse, g: () => growAgain(true), h: () => growAgain(false),
    "+": () => setSpeed(Math.min(Math.log2(app.speed) + 1, 2)), "-": () => setSpeed(Math.max(Math.log2(app.speed) - 1, -3)),
    f: () => follow(!app.isFollowing),
  };
  function onKey(event) {
    const isTyping = event.target.closest("input, select, textarea"), isPressing = event.target.closest("button, summary, a");
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping || (isPressing && event.key === " ")) return;
    const act = KEYS[event.key.toLowerCase()];
    if (!act) return;
    act();
    event.preventDefault();
  }
  function onStageKey(event) {
    const move = { ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] }[event.key];
    if (event.key.toLowerCase() === "b" && app.session.world.hasBall) {
      app.arrows = app.arrows === "ball" ? "target" : "ball";
      app.say(`Arrow keys move the ${app.arrows}.`);
    } else if (move) {
      app.touched();
      const from = app.arrows === "ball" ? app.ball() : app.session.scenario[app.arrows], far = event.shiftKey ? 10 : 2;
      app.moveThing(app.arrows, [from[0] + far * move[0], from[1] + far * move[1]]);
      app.say(`The ${app.arrows} is at ${app.session.scenario[app.arrows].map((v) => v.toFixed(0)).join(", ")}.`, true);
    } else return;
    event.preventDefault();
  }

  function listen() {
    $("play").onclick = () => play(!app.isPlaying);
    $("step").onclick = step;
    $("reset").onclick = reset;
    $("next").onclick = nextCourse;
    $("grow-seed").onclick = () => growAgain(true);
    $("grow-left").onclick = () => growAgain(false);
    $("clear-walls").onclick = () => setWalls([]);
    $("follow").onclick = () => follow(!app.isFollowing);
    $("share").onclick = share;
    $("speed").oninput = () => setSpeed(Number($("speed").value));
    $("file").onchange = () => { if ($("file").files.length) open($("file").files[0]); $("file").value = ""; };
    addEventListener("keydown", onKey);
    $("stage").addEventListener("keydown", onStageKey);
    for (const id of ["robots", "tools", "sizes"]) arrowKeys($(id));
    addEventListener("dragover", (event) => { event.preventDefault(); document.body.classList.add("is-dropping"); });
    addEventListener("dragleave", () => document.body.classList.remove("is-dropping"));
    addEventListener("drop", (event) => {
      event.preventDefault();
      document.body.classList.remove("is-dropping");
      if (event.dataTransfer.files.length) open(event.dataTransfer.files[0]);
    });
    addEventListener("hashchange", () => follows(location.hash));
  }

  async function start() {
    app.content = await NCRSLive.load();
    const first = app.content.robots[0];
    NCRSDrawing.world = app.content.worlds[first.task][first.gridSize];
    stage = NCRSLive.makeStage($("stage"), app);
    editor = NCRSLive.makeEditor($("body"), $("palette"), app);
    hud = NCRSLive.makeHud($("hud"), app);
    numbers = NCRSLive.makeNumbers($("numbers"), app);
    channels = NCRSLive.makeChannels($("channels"), app);
    $("robots").replaceChildren(...app.content.robots.map(thumbnail));
    listen();
    setSpeed(0);
    if (!await follows(location.hash)) {
      const reason = $("problem").textContent; // of a link that could not be used
      show(first);
      if (reason) complain(new Error(reason));
    }
    before = performance.now();
    requestAnimationFrame(frame);
    document.body.dataset.ready = "true";
  }

  Object.assign(NCRSLive, { app, show, growAgain, play, advance });
  start().catch(complain);
})();
