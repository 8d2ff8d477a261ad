// The robots on show, one or two side by side: numbers, growth, channels, episodes, downloads.
"use strict";

(() => {
  const { element } = NCRSReport;
  const shown = []; // robots' indices, at most two
  const players = new Map(); // player of each card
  let isComparing = false;

  const percent = (fraction) => `${(100 * fraction).toFixed(0)} %`;

  function numbers(robot) {
    const { robots } = NCRSReport.overview;
    const champion = NCRSReport.isChampion(robot);
    const episodes = robots.eliteEpisodes === 1 ? "episode" : "episodes";
    const lines = [
      ["Fitness", "fitness", robots.fitness[robot].toFixed(4)],
      ["Success", "success", percent(robots.success[robot])],
      ["Measured in", "episodes", champion ? "scenarios set aside" : `${robots.eliteEpisodes} ${episodes}`],
      ["Found in generation", "generation", String(robots.generation[robot])],
    ];
    if (champion) lines.push(["Source", "source", robots.championSource]);
    return element("dl", { class: "numbers" }, ...lines.map(([name, field, value]) =>
      element("div", {}, element("dt", {}, name), element("dd", { "data-field": field }, value))));
  }

  function save(name, content, type) {
    const link = element("a", { href: URL.createObjectURL(new Blob([content], { type })), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }

  // NumPy's file format, version 1.0: magic, header's length, header, values.
  function npy(raw) {
    const text = `{'descr': '<f4', 'fortran_order': False, 'shape': (${raw.length / 4},), }`;
    const header = text.padEnd(Math.ceil((10 + text.length + 1) / 64) * 64 - 11) + "\n";
    const start = [0x93, ...[..."NUMPY"].map((c) => c.charCodeAt(0)), 1, 0, header.length & 255, header.length >> 8];
    return new Blob([new Uint8Array(start), header, raw]);
  }

  function asJson(robot, raw) {
    const { world, robots } = NCRSReport.overview;
    const view = new DataView(raw.buffer);
    return JSON.stringify({
      task: world.task,
      grid_size: world.gridSize,
      distance_score: world.distanceScore,
      success_radius: world.successRadius,
      measures: robots.measures[robot],
      fitness: robots.fitness[robot],
      success: robots.success[robot],
      generation: robots.generation[robot],
      genome: Array.from({ length: raw.length / 4 }, (_, i) => view.getFloat32(4 * i, true)),
    });
  }

  async function download(robot, kind) {
    try {
      const raw = await NCRSReport.genome(robot);
      const label = NCRSReport.isChampion(robot) ? "champion" : NCRSReport.overview.robots.measures[robot].join("-");
      const name = `${NCRSReport.overview.world.task}_${label}.${kind}`;
      if (kind === "npy") save(name, npy(raw), "application/octet-stream");
      else save(name, asJson(robot, raw), "application/json");
    } catch (error) {
      NCRSReport.complain(error);
    }
  }

  function cellKey() {
    const { world, robots } = NCRSReport.overview;
    const used = new Set(robots.body.slice(0, 400).join("") + robots.body[robots.body.length - 1]);
    const list = element("ul", { class: "cell-key", "aria-label": "Cells" });
    for (const [character, cell] of Object.entries(world.cells)) {
      if (character === "." || !used.has(character)) continue;
      const canvas = element("canvas", { "aria-hidden": "true" });
      NCRSReport.drawSwatch(canvas, character);
      list.append(element("li", {}, canvas, cell.name));
    }
    return list;
  }

  function actions(robot) {
    const { robots, records } = NCRSReport.overview;
    const made = [];
    if (robots.elites > 0 && !isComparing) {
      made.push(element("button", { type: "button", class: "compare", onclick: compare }, "Compare with…"));
    }
    if (isComparing) {
      made.push(element("button", { type: "button", class: "close",
        "aria-label": `Close ${NCRSReport.robotName(robot)}`, onclick: () => close(robot) }, "Close"));
    }
    if (robot >= records.first) {
      for (const kind of ["npy", "json"]) {
        made.push(element("button", { type: "button", class: `download-${kind}`,
          "aria-label": `Download the genome as .${kind}`, onclick: () => download(robot, kind) }, `Genome .${kind}`));
      }
    }
    return element("div", { class: "actions" }, ...made);
  }

  // Fill a card with the robot's record from its data file.
  async function fill(card, robot, canvas) {
    const name = NCRSReport.robotName(robot);
    const body = NCRSReport.overview.robots.body[robot];
    NCRSReport.drawBody(canvas, body);
    let record = null;
    try {
      record = await NCRSReport.record(robot);
    } catch (error) {
      NCRSReport.complain(error);
      return;
    }
    if (!card.isConnected) return;
    if (record === null) {
      card.append(element("p", { class: "quiet" }, "Growth and episodes of elites are not in this report; " +
        "--elites all records them."));
      return;
    }
    const grown = NCRSReport.makeChannels("");
    const driven = NCRSReport.makeChannels("");
    const growth = NCRSReport.makeGrowth(name, body, record, canvas, grown);
    const player = NCRSReport.makePlayer(robot, body, record.episodes, (episode, index) =>
      driven.show(episode.control, 0, `Channels at the end of episode ${index + 1}`));
    card.append(growth.box, player.box, grown.box, driven.box);
    players.set(card, player);
    growth.show();
    player.open();
    card.dataset.ready = "true";
  }

  function makeCard(robot, place) {
    const title = NCRSReport.isChampion(robot) ? "Champion" : "Elite";
    const id = `card-${place}`;
    const canvas = element("canvas", { role: "img", "aria-label": "Body" });
    const card = element("article", { class: "card", "aria-labelledby": id, "data-shows": robot },
      element("div", {}, element("p", { class: "quiet" }, title),
        element("h3", { id }, NCRSReport.robotName(robot))),
      actions(robot),
      element("div", { class: "body-row" }, canvas, numbers(robot)));
    return { card, fill: () => fill(card, robot, canvas) };
  }

  function placeholder() {
    return element("article", { class: "card waiting" },
      element("p", {}, "Choose another robot in the archive to see it beside this one."),
      element("button", { type: "button", class: "close", onclick: () => close(null) }, "Stop comparing"));
  }

  function render() {
    const place = document.getElementById("cards");
    players.forEach((player) => player.pause());
    players.clear();
    const cards = shown.map(makeCard);
    place.replaceChildren(...cards.map(({ card }) => card));
    if (isComparing && shown.length < 2) place.append(placeholder());
    document.getElementById("robots-title").textContent = isComparing ? "Two robots" : "The robot";
    document.getElementById("play-both").hidden = shown.length < 2;
    NCRSReport.markShown(shown);
    const names = shown.map((robot) =>
      NCRSReport.isChampion(robot) ? "champion" : NCRSReport.overview.robots.measures[robot].join("-"));
    history.replaceState(null, "", `#show=${names.join("+")}`);
    return Promise.all(cards.map((card) => card.fill()));
  }

  function compare() {
    isComparing = true;
    render();
    NCRSReport.say("Choose another robot in the archive.");
    NCRSReport.backToArchive();
  }

  function close(robot) {
    isComparing = false;
    const at = shown.indexOf(robot);
    if (at >= 0) shown.splice(at, 1);
    render();
    document.getElementById("robots").focus({ preventScroll: true });
  }

  // Show a robot alone, or as the second of two while comparing.
  NCRSReport.showRobot = (robot) => {
    if (isComparing) shown.splice(1, 1, robot);
    else shown.splice(0, 2, robot);
    const { fitness } = NCRSReport.overview.robots;
    NCRSReport.say(`Showing ${NCRSReport.robotName(robot)}, fitness ${fitness[robot].toFixed(4)}.`);
    return render();
  };

  NCRSReport.showTwo = (first, second) => {
    isComparing = true;
    shown.splice(0, 2, first, second);
    return render();
  };

  NCRSReport.prepareRobots = () => {
    const both = element("button", { type: "button", id: "play-both", class: "main", hidden: true, onclick: () => {
      players.forEach((player) => { player.pause(); player.seek(0); player.start(); });
    } }, "Play both");
    const back = element("button", { type: "button", class: "back",
      onclick: () => NCRSReport.backToArchive() }, "Back to the archive");
    const isAlone = NCRSReport.overview.robots.elites === 0;
    document.getElementById("cards").before(element("div", { class: "actions bar-top" }, isAlone ? null : back, both));
    document.getElementById("cards").after(cellKey());
    window.addEventListener("resize", () => players.forEach((player) => player.draw()));
  };
})();
