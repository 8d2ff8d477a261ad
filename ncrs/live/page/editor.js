// The robot's body, large: cells are cut off, or painted on, while it lives.
"use strict";

(() => {
  const { element } = NCRSPage;
  const MARGIN = 0.6; // cells around the body, as drawBody leaves them

  NCRSLive.makeEditor = (canvas, palette, app) => {
    let code = 0; // what a click puts into a cell
    let cursor = -1; // the cell that the keyboard chose
    let painting = false;
    const world = () => app.session.world;
    const names = () => Object.fromEntries(Object.values(world().cells).map((cell) => [cell.code, cell.name]));

    function choose(part) {
      code = part;
      for (const button of palette.children) {
        const isChosen = Number(button.dataset.code) === part;
        button.setAttribute("aria-checked", isChosen);
        button.tabIndex = isChosen ? 0 : -1;
      }
    }
    // The parts of the task, after "cut off".
    function fillPalette() {
      const parts = Object.entries(world().cells).filter(([, cell]) => cell.code === 0 || world().partCodes.includes(cell.code));
      palette.replaceChildren(...parts.map(([character, cell]) => {
        const picture = cell.code === 0 ? element("span", { class: "scissors", "aria-hidden": "true" }, "✂")
          : element("canvas", { "aria-hidden": "true" });
        const button = element("button", { type: "button", role: "radio", "data-code": cell.code,
          onclick: () => choose(cell.code) }, picture, cell.code === 0 ? "cut off" : cell.name);
        if (cell.code !== 0) requestAnimationFrame(() => NCRSDrawing.drawSwatch(picture, character));
        return button;
      }));
      choose(world().partCodes.includes(code) ? code : 0);
    }
    palette.addEventListener("keydown", (event) => {
      const buttons = [...palette.children], at = buttons.findIndex((button) => button.tabIndex === 0);
      const by = { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 }[event.key];
      if (by === undefined) return;
      const next = buttons[(at + by + buttons.length) % buttons.length];
      choose(Number(next.dataset.code));
      next.focus();
      event.preventDefault();
    });

    function put(index, part = code) {
      const { session } = app;
      if (session.body.data[index] === part) return;
      session.repairSteps = app.isRepairing ? world().repairSteps : 0;
      if (!session.setCell(index, part)) {
        app.say("The last cell stays: without it there is nothing to drive.");
        return;
      }
      const n = world().gridSize;
      app.changed(`${part === 0 ? "Cut off" : `Put a ${names()[part]} into`} row ${Math.floor(index / n) + 1}, column ${(index % n) + 1}.`);
    }
    function cellAt(event) {
      const box = canvas.getBoundingClientRect(), n = world().gridSize;
      const side = box.width / (n + MARGIN);
      const column = Math.floor((event.clientX - box.x - box.width / 2) / side + n / 2);
      const row = Math.floor((event.clientY - box.y - box.height / 2) / side + n / 2);
      return row >= 0 && row < n && column >= 0 && column < n ? row * n + column : -1;
    }
    canvas.addEventListener("pointerdown", (event) => {
      const index = cellAt(event);
      cursor = -1;
      if (!event.isPrimary || index < 0) return;
      painting = event.button === 0;
      put(index, event.button === 2 ? 0 : code);
    });
    canvas.addEventListener("pointermove", (event) => {
      const index = cellAt(event);
      if (painting && event.buttons === 1 && index >= 0) put(index);
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { painting = false; });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("blur", () => { cursor = -1; });
    canvas.addEventListener("keydown", (event) => {
      const n = world().gridSize, move = { ArrowUp: -n, ArrowDown: n, ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (move !== undefined) {
        const from = cursor < 0 ? Math.floor((n * n) / 2) : cursor;
        const isOut = cursor >= 0 && ((event.key === "ArrowLeft" && from % n === 0) || (event.key === "ArrowRight" && from % n === n - 1));
        const to = cursor < 0 ? from : from + move;
        if (!isOut && to >= 0 && to < n * n) cursor = to;
        app.say(`Row ${Math.floor(cursor / n) + 1}, column ${(cursor % n) + 1}: ${names()[app.session.body.data[cursor]]}`, true);
      } else if (event.key === "Enter" && cursor >= 0) put(cursor);
      else if (/^[0-4]$/.test(event.key) && (event.key === "0" || world().partCodes.includes(Number(event.key)))) choose(Number(event.key));
      else return;
      event.preventDefault();
      event.stopPropagation();
    });

    function draw() {
      const { session } = app, isDriving = session.phase !== "growing", n = world().gridSize;
      const body = app.characters();
      if (isDriving) NCRSDrawing.drawBody(canvas, body, session.sensed.data, Array.from(session.gas, (g) => Math.min(Math.max(g, -1), 1)), app.showsValues);
      else NCRSDrawing.drawBody(canvas, body);
      if (cursor < 0) return;
      const context = canvas.getContext("2d"), { cellSize, palette: colors } = world();
      const x = ((cursor % n) - (n - 1) / 2) * cellSize, y = (Math.floor(cursor / n) - (n - 1) / 2) * cellSize;
      context.strokeStyle = colors.white;
      context.lineWidth = 0.16;
      context.strokeRect(x - 1, y - 1, 2, 2);
    }
    // The body in words, for those who do not see it.
    function describe() {
      const n = world().gridSize, rows = app.characters().match(new RegExp(`.{${n}}`, "g"));
      canvas.setAttribute("aria-label", `Body, row by row from the front: ${rows.join(" ")}`);
    }
    return { draw, describe, fillPalette };
  };
})();
