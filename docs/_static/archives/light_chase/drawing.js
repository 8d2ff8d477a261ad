// Drawing of bodies, channels and episodes on canvases, in the colours of the suite's renderer.
"use strict";

(() => {
  // A canvas's context in CSS pixels, sharp on dense screens; side is its width and height.
  function surface(canvas, side) {
    const density = Math.min(window.devicePixelRatio || 1, 3);
    const pixels = Math.round(side * density);
    if (canvas.width !== pixels || canvas.height !== pixels) {
      canvas.width = pixels;
      canvas.height = pixels;
    }
    const context = canvas.getContext("2d");
    context.setTransform(density, 0, 0, density, 0, 0);
    context.clearRect(0, 0, side, side);
    return context;
  }

  const known = new Map();
  function parts(color) {
    if (!known.has(color)) known.set(color, color.match(/\d+/g).map(Number));
    return known.get(color);
  }

  // A colour between two others, as "rgb(r, g, b)".
  function mix(from, to, fraction) {
    const [a, b] = [parts(from), parts(to)];
    return `rgb(${a.map((value, i) => Math.round(value + (b[i] - value) * fraction)).join(", ")})`;
  }

  const shades = new Map();
  // The colour of a sensor: nearly dark at value 0, nearly white at 1.
  function lit(hue, value) {
    const { ground, white } = NCRSDrawing.world.palette;
    const part = Math.round(255 * Math.min(Math.max(value, 0), 1)) / 255; // each is mixed once
    const key = `${hue} ${part}`;
    if (!shades.has(key)) shades.set(key, mix(mix(ground, hue, 0.2), mix(hue, white, 0.7), part));
    return shades.get(key);
  }

  function fillDisc(context, radius, color) {
    context.fillStyle = color;
    context.beginPath();
    context.arc(0, 0, radius, 0, 2 * Math.PI);
    context.fill();
  }

  function fillPolygon(context, points, color) {
    context.fillStyle = color;
    context.beginPath();
    points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.closePath();
    context.fill();
  }

  function fillDiamond(context, reach, color) {
    fillPolygon(context, [[-reach, 0], [0, -reach], [reach, 0], [0, reach]], color);
  }

  // The colour of a sensor, by its character.
  function sensorColor(character) {
    const { palette } = NCRSDrawing.world;
    return { T: palette.sky, C: palette.rose }[character] ?? palette.amber;
  }

  // One cell, centred on the origin, of side 2; value is a sensor's, gas a wheel's. The shapes and
  // colours are those of ncrs_envs.rendering.
  function drawCell(context, character, value, gas) {
    const { palette, cells } = NCRSDrawing.world;
    const cell = cells[character];
    const fill = (color, x, y, width, height) => {
      context.fillStyle = color;
      context.fillRect(x, y, width, height);
    };
    fill(palette.cell_edge, -1, -1, 2, 2);
    fill(cell.senses || cell.drives ? palette.sensor_base : palette.tissue, -0.92, -0.92, 1.84, 1.84);
    if (character === "C") {
      fill(palette.rose, -0.8, -0.8, 1.6, 1.6);
      fill(lit(palette.rose, value), -0.55, -0.55, 1.1, 1.1);
    } else if (character === "T") {
      fillDiamond(context, 0.98, palette.sky);
      fillDiamond(context, 0.66, lit(palette.sky, value));
    } else if (cell.senses) {
      fillDisc(context, 0.85, palette.amber);
      fillDisc(context, 0.6, lit(palette.amber, value));
    } else if (cell.drives) {
      fill(palette.wheel_base, -0.62, -0.92, 1.24, 1.84);
      fill(gas >= 0 ? palette.green : palette.vermilion, -0.45, 0.2, 0.9, -0.7 * gas);
      fillPolygon(context, [[-0.6, -0.5], [0.6, -0.5], [0, -0.92]], palette.white);
    }
  }

  // A body in the current frame, whose y axis points down and whose unit is the world's.
  function drawRobot(context, body, values, gas) {
    const { gridSize: n, cellSize, palette } = NCRSDrawing.world;
    const place = (i) => [((i % n) - (n - 1) / 2) * cellSize, (Math.floor(i / n) - (n - 1) / 2) * cellSize];
    context.fillStyle = palette.white;
    for (let i = 0; i < n * n; i++) {
      if (body[i] === ".") continue;
      const [x, y] = place(i);
      context.fillRect(x - 1.18, y - 1.18, 2.36, 2.36);
    }
    for (let i = 0; i < n * n; i++) {
      if (body[i] === ".") continue;
      context.save();
      context.translate(...place(i));
      context.scale(cellSize / 2, cellSize / 2);
      drawCell(context, body[i], values ? values[i] : 1, gas ? gas[i] : 0);
      context.restore();
    }
  }

  // A body alone, front up; if numbers is true, with sensor values and gas written into its cells.
  function drawBody(canvas, body, values, gas, numbers = false) {
    const { gridSize: n, cellSize, palette, cells } = NCRSDrawing.world;
    const side = canvas.clientWidth || 120;
    const context = surface(canvas, side);
    context.fillStyle = palette.ground;
    context.fillRect(0, 0, side, side);
    const scale = side / ((n + 0.6) * cellSize);
    context.translate(side / 2, side / 2);
    context.scale(scale, scale);
    context.fillStyle = palette.grid;
    for (let i = 0; i < n * n; i++) {
      const x = ((i % n) - (n - 1) / 2) * cellSize, y = (Math.floor(i / n) - (n - 1) / 2) * cellSize;
      context.fillRect(x - 0.94, y - 0.94, 1.88, 1.88);
    }
    drawRobot(context, body, values, gas);
    if (!numbers) return;
    context.font = "600 0.62px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.lineWidth = 0.18;
    context.strokeStyle = palette.wheel_base;
    context.fillStyle = palette.white;
    for (let i = 0; i < n * n; i++) {
      const cell = cells[body[i]];
      if (!cell.senses && !cell.drives) continue;
      const x = ((i % n) - (n - 1) / 2) * cellSize, y = (Math.floor(i / n) - (n - 1) / 2) * cellSize;
      const text = (cell.senses ? values[i] : gas[i]).toFixed(2);
      context.strokeText(text, x, y);
      context.fillText(text, x, y);
    }
  }

  function circle(context, [x, y], radius) {
    context.beginPath();
    context.arc(x, -y, radius, 0, 2 * Math.PI);
  }

  function ring(context, point, radius, color) {
    context.strokeStyle = color;
    context.lineWidth = 0.5;
    context.setLineDash([1.6, 1.6]);
    circle(context, point, radius);
    context.stroke();
    context.setLineDash([]);
  }

  function drawField(context, reach) {
    const { extent, palette } = NCRSDrawing.world;
    context.fillStyle = palette.ground;
    context.fillRect(-reach, -reach, 2 * reach, 2 * reach);
    context.strokeStyle = palette.grid;
    context.lineWidth = 0.25;
    context.beginPath();
    for (let i = 0; i <= 12; i++) {
      const at = -extent + (2 * extent * i) / 12;
      context.moveTo(at, -extent);
      context.lineTo(at, extent);
      context.moveTo(-extent, at);
      context.lineTo(extent, at);
    }
    context.stroke();
    context.strokeStyle = palette.border;
    context.lineWidth = 0.4;
    context.strokeRect(-extent, -extent, 2 * extent, 2 * extent);
  }

  function drawWalls(context, quads) {
    const { palette } = NCRSDrawing.world;
    context.fillStyle = palette.wall;
    context.strokeStyle = palette.wall; // closes the seams between neighbouring pieces
    context.lineWidth = 0.2;
    for (const quad of quads) {
      context.beginPath();
      quad.forEach(([x, y], i) => (i ? context.lineTo(x, -y) : context.moveTo(x, -y)));
      context.closePath();
      context.fill();
      context.stroke();
    }
    context.strokeStyle = palette.wall_edge;
    context.lineWidth = 0.5;
    context.beginPath();
    for (const [, from, to] of quads) {
      context.moveTo(from[0], -from[1]);
      context.lineTo(to[0], -to[1]);
    }
    context.stroke();
  }

  function drawGoals(context, scenario, ball) {
    const world = NCRSDrawing.world, { palette } = world;
    if (scenario.light) {
      ring(context, scenario.light, world.successRadius, palette.amber);
      context.fillStyle = palette.amber;
      context.globalAlpha = 0.25;
      circle(context, scenario.light, 4 * world.lightRadius);
      context.fill();
      context.globalAlpha = 1;
      circle(context, scenario.light, 1.6 * world.lightRadius);
      context.fill();
    }
    if (scenario.target) {
      const [x, y] = scenario.target, half = world.targetSide / 2;
      context.strokeStyle = palette.sky;
      context.lineWidth = 0.7;
      context.strokeRect(x - half, -y - half, 2 * half, 2 * half);
      ring(context, scenario.target, world.successRadius, palette.sky);
    }
    if (ball) {
      context.fillStyle = palette.amber;
      circle(context, ball, world.ballRadius);
      context.fill();
      context.strokeStyle = palette.white;
      context.lineWidth = 0.3;
      context.stroke();
    }
  }

  // An episode at one moment: see player.js for the frame.
  function drawEpisode(canvas, body, scenario, frame) {
    const world = NCRSDrawing.world;
    const side = canvas.clientWidth || 320;
    const context = surface(canvas, side);
    const reach = world.wallExtent * world.extent * 1.01;
    context.translate(side / 2, side / 2);
    context.scale(side / (2 * reach), side / (2 * reach));
    drawField(context, reach);
    drawWalls(context, scenario.walls);
    drawGoals(context, scenario, frame.ball);
    context.strokeStyle = world.palette.tissue;
    context.lineWidth = 0.6;
    context.beginPath();
    frame.path.forEach(([x, y], i) => (i ? context.lineTo(x, -y) : context.moveTo(x, -y)));
    context.stroke();
    const [x, y, angle] = frame.pose;
    context.translate(x, -y);
    context.rotate(-angle);
    drawRobot(context, body, frame.values, frame.gas);
  }

  // One channel as n x n squares.
  function drawChannel(canvas, values) {
    const n = NCRSDrawing.world.gridSize;
    if (canvas.width !== n || canvas.height !== n) {
      canvas.width = n;
      canvas.height = n;
    }
    const image = new ImageData(n, n);
    values.forEach((value, i) => {
      image.data.set(NCRSDrawing.signedRgb(value), 4 * i);
      image.data[4 * i + 3] = 255;
    });
    canvas.getContext("2d").putImageData(image, 0, 0);
  }

  // A single cell as a small picture.
  function drawSwatch(canvas, character) {
    const context = surface(canvas, 16);
    context.translate(8, 8);
    context.scale(8, 8);
    drawCell(context, character, 1, 0);
  }

  Object.assign(NCRSDrawing, { surface, mix, sensorColor, drawBody, drawRobot, drawField, drawWalls, drawGoals, drawEpisode, drawChannel, drawSwatch });
})();
