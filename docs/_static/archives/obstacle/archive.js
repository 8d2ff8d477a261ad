// The archive: a grid of sensors x wheels for each number of cells. It is one tab stop: arrow keys
// move from cell to cell.
"use strict";

(() => {
  const { element } = NCRSReport;
  const byMeasures = new Map(); // element of each possible triple
  let current = null;

  const name = (measures) => measures.join("-");
  const isWide = () => window.matchMedia("(min-width: 70rem)").matches;

  const COLUMNS = {
    fitness: { text: (value) => value.toFixed(4) },
    success: { text: (value) => `${(100 * value).toFixed(0)} %`, range: [0, 1] },
    generation: { text: (value) => String(value) },
  };

  function describe(cell) {
    const [sensors, wheels, cells] = cell.dataset.measures.split("-");
    if (cell.dataset.robot === undefined) {
      return `${sensors} sensors, ${wheels} wheels, ${cells} cells: no elite`;
    }
    const robot = Number(cell.dataset.robot), { robots } = NCRSReport.overview;
    return `${NCRSReport.robotName(robot)}: fitness ${COLUMNS.fitness.text(robots.fitness[robot])}, ` +
      `success ${COLUMNS.success.text(robots.success[robot])}, ` +
      `found in generation ${robots.generation[robot]}`;
  }

  function makePanel(cells, [minSensors, minWheels], robotAt) {
    const grid = element("div", { role: "grid", class: "grid", "aria-describedby": "archive-keys",
      "aria-label": `${cells} cells: sensors to the right, wheels upwards` });
    for (let wheels = cells - minSensors; wheels >= minWheels; wheels--) {
      const row = element("div", { role: "row" });
      for (let sensors = minSensors; sensors + wheels <= cells; sensors++) {
        const measures = name([sensors, wheels, cells]);
        const cell = element("div", { role: "gridcell", tabindex: -1, "data-measures": measures,
          "data-robot": robotAt.get(measures), "aria-selected": "false" });
        cell.setAttribute("aria-label", describe(cell));
        byMeasures.set(measures, cell);
        row.append(cell);
      }
      grid.append(row);
    }
    return element("div", { class: "panel" }, element("h3", {}, `${cells} cells`), grid,
      element("div", { class: "axes", "aria-hidden": "true" },
        element("span", {}, `${minSensors}`), element("span", {}, cells > 8 ? "sensors →" : ""),
        element("span", {}, `${cells - minWheels}`)));
  }

  function paint() {
    const by = document.getElementById("colour-by").value;
    const { robots } = NCRSReport.overview;
    const values = robots[by].slice(0, robots.elites);
    const [low, high] = COLUMNS[by].range || [Math.min(...values), Math.max(...values)];
    for (const cell of byMeasures.values()) {
      if (cell.dataset.robot === undefined) continue;
      cell.style.background = NCRSReport.amountColor(values[Number(cell.dataset.robot)], low, high);
    }
    const ramp = element("span", { class: "ramp" });
    ramp.style.background = NCRSReport.ramp("amount");
    document.getElementById("legend").replaceChildren(
      element("span", { class: "low" }, COLUMNS[by].text(low)), ramp,
      element("span", { class: "high" }, COLUMNS[by].text(high)),
      element("span", { class: "hole" }), element("span", {}, "no elite"));
  }

  function move(cell, focus) {
    if (current) current.tabIndex = -1;
    current = cell;
    cell.tabIndex = 0;
    document.getElementById("cell-info").textContent = describe(cell);
    if (focus) {
      cell.focus({ preventScroll: true });
      cell.scrollIntoView({ block: "nearest", inline: "nearest" });
    }
  }

  function choose(cell) {
    move(cell, false);
    if (cell.dataset.robot === undefined) {
      NCRSReport.say(describe(cell));
      return;
    }
    const isShown = NCRSReport.showRobot(Number(cell.dataset.robot));
    if (isWide()) return;
    const robots = document.getElementById("robots");
    robots.focus({ preventScroll: true });
    robots.scrollIntoView();
    isShown.then(() => robots.scrollIntoView()); // the card has made the page longer
  }

  function neighbour(key) {
    const [sensors, wheels, cells] = current.dataset.measures.split("-").map(Number);
    const at = (...measures) => byMeasures.get(name(measures));
    const row = current.parentElement;
    return {
      ArrowRight: () => at(sensors + 1, wheels, cells),
      ArrowLeft: () => at(sensors - 1, wheels, cells),
      ArrowUp: () => at(sensors, wheels + 1, cells),
      ArrowDown: () => at(sensors, wheels - 1, cells),
      PageUp: () => at(sensors, wheels, cells + 1),
      PageDown: () => at(sensors, wheels, cells - 1),
      Home: () => row.firstElementChild,
      End: () => row.lastElementChild,
    }[key];
  }

  function press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      choose(event.target);
      return;
    }
    const find = neighbour(event.key);
    if (!find) return;
    event.preventDefault();
    const next = find();
    if (next) move(next, true);
  }

  function find(event) {
    event.preventDefault();
    const form = event.target.elements;
    const measures = ["sensors", "wheels", "cells"].map((field) => form[field].value.trim());
    const cell = byMeasures.get(measures.join("-"));
    if (cell && cell.dataset.robot !== undefined) choose(cell);
    const info = cell ? describe(cell)
      : `No body of this task can have ${measures[0]} sensors, ${measures[1]} wheels and ${measures[2]} cells.`;
    document.getElementById("cell-info").textContent = info;
    NCRSReport.say(info);
  }

  NCRSReport.prepareArchive = () => {
    const { robots } = NCRSReport.overview;
    const panels = document.getElementById("panels");
    if (!panels) return;
    const [minSensors, minWheels, maxCells] = robots.space;
    const robotAt = new Map(robots.measures.slice(0, robots.elites).map((measures, i) => [name(measures), i]));
    panels.style.setProperty("--longest", maxCells - minSensors - minWheels + 1);
    for (let cells = minSensors + minWheels; cells <= maxCells; cells++) {
      panels.append(makePanel(cells, robots.space, robotAt));
    }
    panels.addEventListener("click", (event) => {
      const cell = event.target.closest("[role=gridcell]");
      if (cell) choose(cell);
    });
    panels.addEventListener("keydown", press);
    panels.addEventListener("focusin", (event) => {
      if (event.target !== current && event.target.dataset.measures) move(event.target, false);
    });
    panels.addEventListener("pointerover", (event) => {
      const cell = event.target.closest("[role=gridcell]");
      if (cell) document.getElementById("cell-info").textContent = describe(cell);
    });
    document.getElementById("colour-by").addEventListener("change", paint);
    document.getElementById("find").addEventListener("submit", find);
    paint();
    move(byMeasures.get(name(robots.measures[NCRSReport.bestElite()])), false);
  };

  NCRSReport.bestElite = () => {
    const { fitness, elites } = NCRSReport.overview.robots;
    let best = 0;
    for (let i = 1; i < elites; i++) if (fitness[i] > fitness[best]) best = i;
    return best;
  };

  NCRSReport.markShown = (shown) => {
    for (const cell of byMeasures.values()) {
      const isShown = shown.includes(Number(cell.dataset.robot ?? -1));
      if ((cell.getAttribute("aria-selected") === "true") !== isShown) {
        cell.setAttribute("aria-selected", String(isShown));
      }
    }
  };

  NCRSReport.backToArchive = () => {
    if (current) move(current, true);
  };

  NCRSReport.robotWithMeasures = (measures) => {
    const robot = byMeasures.get(measures)?.dataset.robot;
    return robot === undefined ? null : Number(robot);
  };
})();
