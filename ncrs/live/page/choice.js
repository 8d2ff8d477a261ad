// Which robot lives: one of the page's, one from a file, or one that an address holds.
"use strict";

NCRSLive.addChoice = (app) => {
  const { element } = NCRSPage;
  const $ = (id) => document.getElementById(id);

  function thumbnail(robot) {
    const canvas = element("canvas", { "aria-hidden": "true" });
    const world = app.content.worlds[robot.task][robot.gridSize];
    const known = Number.isFinite(robot.success) ? `${NCRSLive.percent(robot.success)} success` : "untested";
    const button = element("button", { type: "button", role: "radio", "data-id": robot.id ?? "", onclick: () => app.show(robot) },
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
    const session = app.makeSession(robot, robot.gridSize);
    while (!session.grow());
    app.session = session;
    robot.body = app.characters();
    robot.note ||= "It came from a file or a link.";
    $("robots").prepend(thumbnail(robot));
    return robot;
  }
  async function open(file) {
    try {
      const before = app.session;
      const robot = await NCRSLive.readRobot(file, app.content.worlds, app.robot.task);
      app.session = before;
      app.show(adopt(robot));
      app.say(`${robot.title} is alive.`);
    } catch (error) {
      app.complain(error);
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
      const session = app.makeSession(robot, size);
      NCRSLive.restore(session, saved);
      if (robot.isOwn) robot = adopt(robot);
      app.show(robot, size, session.scenario);
      if (saved.body !== undefined) {
        app.begin(session);
        app.play(false);
        app.turn("isRepeating", "repeat", saved.isRepeating === true);
        app.setSpeed(Number.isFinite(saved.speed) ? Math.min(Math.max(Math.round(Math.log2(saved.speed)), -3), 2) : 0);
      }
      return true;
    } catch (error) {
      app.complain(error);
      return false;
    }
  }

  app.follows = follows;
  $("robots").replaceChildren(...app.content.robots.map(thumbnail));
  $("share").onclick = share;
  $("file").onchange = () => {
    if ($("file").files.length) open($("file").files[0]);
    $("file").value = "";
  };
  addEventListener("dragover", (event) => { event.preventDefault(); document.body.classList.add("is-dropping"); });
  addEventListener("dragleave", () => document.body.classList.remove("is-dropping"));
  addEventListener("drop", (event) => {
    event.preventDefault();
    document.body.classList.remove("is-dropping");
    if (event.dataTransfer.files.length) open(event.dataTransfer.files[0]);
  });
  addEventListener("hashchange", () => follows(location.hash));
};
