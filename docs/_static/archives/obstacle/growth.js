// Growth step by step, and the automaton's channels as small heatmaps.
"use strict";

(() => {
  const { element } = NCRSReport;
  const STEP_MS = 350;

  // One heatmap for each channel; show(states, from) reads channels first, then cells.
  NCRSReport.makeChannels = (title) => {
    const { channels, gridSize } = NCRSReport.overview.world;
    const size = gridSize * gridSize;
    const heading = element("h4", {}, title);
    const canvases = channels.map(() => element("canvas", { role: "img" }));
    const limit = NCRSReport.overview.world.signedLimit;
    const low = element("span", {}, `−${limit} or less`), high = element("span", {}, `${limit} or more`);
    const figures = channels.map((name, i) =>
      element("figure", { class: "channel" }, canvases[i], element("figcaption", {}, name.replace("/", "/\u200b"))));
    const ramp = element("span");
    ramp.style.background = NCRSReport.ramp("signed");
    const box = element("div", {}, heading, element("div", { class: "channels" }, ...figures),
      element("div", { class: "scale", "aria-hidden": "true" }, low, ramp, high));

    function show(states, from, text) {
      const all = states.subarray(from, from + channels.length * size);
      heading.textContent = text;
      channels.forEach((name, i) => {
        const values = all.subarray(i * size, (i + 1) * size);
        NCRSReport.drawChannel(canvases[i], values);
        const range = `${Math.min(...values).toFixed(2)} to ${Math.max(...values).toFixed(2)}`;
        canvases[i].setAttribute("aria-label", `Channel ${name}: ${range}`);
        figures[i].title = `${name}: ${range}`;
      });
    }
    return { box, show };
  };

  // The body after each growth step, with a slider; its last step is the archive's body.
  NCRSReport.makeGrowth = (name, body, record, canvas, channels) => {
    const { cells, channels: names, gridSize } = NCRSReport.overview.world;
    const size = gridSize * gridSize;
    const steps = record.bodies.length / size - 1;
    const characters = Object.entries(cells).sort((a, b) => a[1].code - b[1].code).map(([c]) => c);
    let timer = 0;

    const text = element("output", { class: "quiet" });
    const slider = element("input", { type: "range", min: 0, max: steps, step: 1, value: steps,
      class: "growth-step", "aria-label": `Growth step, ${name}`, oninput: () => { stop(); show(); } });
    const play = element("button", { type: "button", onclick: () => (timer ? stop() : start()) }, "Grow");

    function bodyAt(step) {
      if (step === steps) return body;
      return [...record.bodies.subarray(step * size, (step + 1) * size)].map((code) => characters[code]).join("");
    }
    function show() {
      const step = Number(slider.value);
      const grown = bodyAt(step);
      NCRSReport.drawBody(canvas, grown);
      canvas.setAttribute("aria-label", `Body after growth step ${step}, row by row from the front: ` +
        grown.match(new RegExp(`.{${gridSize}}`, "g")).join(" "));
      text.textContent = step === 0 ? "seed" : `step ${step} of ${steps}`;
      slider.setAttribute("aria-valuetext", text.textContent);
      const when = step === 0 ? "of the seed" : step === steps ? "at the end of growth" : `after growth step ${step}`;
      channels.show(record.states, step * names.length * size, `Channels ${when}`);
    }
    function start() {
      if (Number(slider.value) >= steps) slider.value = 0;
      show();
      play.textContent = "Pause";
      timer = setInterval(() => {
        slider.value = Number(slider.value) + 1;
        show();
        if (Number(slider.value) >= steps || !canvas.isConnected) stop();
      }, STEP_MS);
    }
    function stop() {
      clearInterval(timer);
      timer = 0;
      play.textContent = "Grow";
    }
    const box = element("div", { class: "growth" },
      element("h4", {}, "Growth"),
      element("div", { class: "controls growth-controls" }, play, slider, text));
    return { box, show };
  };
})();
