// A robot of the report, live: the page in which robots grow and drive, over this one.
"use strict";

(() => {
  const { element, base64 } = NCRSPage;
  const PAGE = "live.html";

  // The address of the robot in the course of an episode; see link.js of the live page.
  async function address(robot, episode) {
    const { world, robots } = NCRSReport.overview;
    const { start, light, ball, target, walls } = world.scenarios[episode];
    const state = {
      version: 1,
      robot: {
        title: NCRSReport.robotName(robot), note: `As in the report, episode ${episode + 1}.`, task: world.task, gridSize: world.gridSize,
        distanceScore: world.distanceScore, successRadius: world.successRadius,
        fitness: robots.fitness[robot], success: robots.success[robot],
        genome: base64(await NCRSReport.genome(robot)),
      },
      scenario: { start, light, ball, target, walls },
    };
    const text = base64(new TextEncoder().encode(JSON.stringify(state)));
    return `${PAGE}#j=${text.replace(/\+/g, "-").replace(/\//g, "_").replace(/=+$/, "")}`;
  }

  async function open(robot, episode) {
    try {
      const frame = element("iframe", { src: await address(robot, episode), title: `${NCRSReport.robotName(robot)}, live` });
      const close = element("button", { type: "button", class: "close-live", onclick: () => dialog.close() }, "Back to the report");
      const dialog = element("dialog", { class: "live", "aria-label": "Live", onclose: () => dialog.remove() }, close, frame);
      document.body.append(dialog);
      dialog.showModal();
    } catch (error) {
      NCRSReport.complain(error);
    }
  }

  // A button that opens a robot in the course of the episode that episode() names.
  NCRSReport.makeLiveButton = (robot, episode) => element("button", { type: "button", class: "open-live",
    "aria-label": `${NCRSReport.robotName(robot)}, live`, onclick: () => open(robot, episode()) }, "Live");
})();
