// Buttons and keys.
"use strict";

NCRSLive.addControls = (app) => {
  const { element } = NCRSPage;
  const TOOLS = [["lead", "Lead"], ["wall", "Wall"], ["erase", "Erase"]];
  const $ = (id) => document.getElementById(id);

  function radios(place, choices, isChosen, choose) {
    place.replaceChildren(...choices.map(([value, label]) => element("button", { type: "button", role: "radio",
      "aria-checked": String(isChosen(value)), tabindex: isChosen(value) ? 0 : -1, "data-value": value, onclick: () => choose(value) }, label)));
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
    $("tools").hidden = !isFree;
    const seconds = app.session.world.steps * app.session.world.dt;
    $("hint").textContent = !isFree ? "Drag the ball or the target."
      : app.robot.follows ? "Drag the light: the robot follows it."
        : `Put the light somewhere. This robot was bred to reach it within ${seconds} seconds, from rest.`;
  }
  function fillSizes() {
    const sizes = Object.keys(app.content.worlds[app.robot.task]).map(Number);
    radios($("sizes"), sizes.map((n) => [n, String(n)]), (n) => n === app.session.world.gridSize, (n) => app.show(app.robot, n));
  }

  const toggle = (name, id) => app.turn(name, id, !app[name]);
  const KEYS = {
    " ": () => app.play(!app.isPlaying), ".": app.step, r: app.reset, n: app.nextCourse, g: () => app.growAgain(true), h: () => app.growAgain(false),
    "+": () => app.setSpeed(Math.min(Math.log2(app.speed) + 1, 2)), "-": () => app.setSpeed(Math.max(Math.log2(app.speed) - 1, -3)),
    f: () => toggle("isFollowing", "follow"), v: () => toggle("showsValues", "values"), e: () => toggle("isRepeating", "repeat"), a: () => toggle("isRepairing", "repair"),
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
      const to = [from[0] + far * move[0], from[1] + far * move[1]];
      app.moveThing(app.arrows, to);
      app.say(`The ${app.arrows} is at ${to.map((v) => v.toFixed(0)).join(", ")}.`, true);
    } else return;
    event.preventDefault();
  }

  $("play").onclick = () => app.play(!app.isPlaying);
  $("step").onclick = app.step;
  $("reset").onclick = app.reset;
  $("next").onclick = app.nextCourse;
  $("grow-seed").onclick = () => app.growAgain(true);
  $("grow-left").onclick = () => app.growAgain(false);
  $("clear-walls").onclick = () => app.setWalls([]);
  $("follow").onclick = () => toggle("isFollowing", "follow");
  $("values").onclick = () => toggle("showsValues", "values");
  $("repair").onclick = () => toggle("isRepairing", "repair");
  $("repeat").onclick = () => toggle("isRepeating", "repeat");
  $("speed").oninput = () => app.setSpeed(Number($("speed").value));
  addEventListener("keydown", onKey);
  $("stage").addEventListener("keydown", onStageKey);
  for (const id of ["robots", "tools", "sizes"]) arrowKeys($(id));
  Object.assign(app, { fillSizes, showTools });
};
