// Starts the page when its overview has arrived.
"use strict";

(() => {
  // Robots that the address names, as #show=3-4-12 or #show=champion+3-4-12.
  function asked() {
    const { champion } = NCRSReport.overview.robots;
    const match = /^#show=([\w+-]+)$/.exec(location.hash);
    if (!match) return [];
    return match[1].split("+").slice(0, 2)
      .map((name) => (name === "champion" ? champion : NCRSReport.robotWithMeasures(name)))
      .filter((robot) => robot !== null);
  }

  function showChampionButton() {
    const { champion } = NCRSReport.overview.robots;
    const bar = document.querySelector(".bar-top");
    if (champion === null || !document.getElementById("panels")) return;
    bar.append(NCRSReport.element("button", { type: "button", id: "show-champion",
      onclick: () => NCRSReport.showRobot(champion) }, "Champion"));
  }

  NCRSReport.start = (overview) => {
    NCRSReport.overview = overview;
    NCRSDrawing.world = overview.world;
    NCRSReport.showCharts();
    NCRSReport.prepareRobots();
    NCRSReport.prepareArchive();
    showChampionButton();
    const robots = asked();
    const first = overview.robots.champion ?? NCRSReport.bestElite();
    const ready = robots.length === 2 ? NCRSReport.showTwo(...robots) : NCRSReport.showRobot(robots[0] ?? first);
    ready.then(() => { document.body.dataset.ready = "true"; });
  };
})();
