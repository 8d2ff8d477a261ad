// The playfield: the robot, where it has been, what it seeks, and what the pointer does there.
"use strict";

(() => {
  const GROWING_VIEW = 13; // half the view's width in units
  const FOLLOWING_VIEW = 34;
  const TRAIL = 500; // points
  const TRAIL_PIECE = 12; // points of one brightness
  const SPRITE = 64; // side of a painted light or flame, in pixels
  const GRAB = 9; // how near to the ball or the target the pointer takes it, in units

  // The stage of an app, see app.js; draw() draws it and trace() keeps where the robot was.
  NCRSLive.makeStage = (canvas, app) => {
    const camera = { x: 0, y: 0, half: 0 };
    const trail = [];
    let held = null; // what the pointer drags
    let wall = null; // the wall that is being drawn: its two ends

    const world = () => app.session.world;
    const wholeView = () => world().wallExtent * world().extent * 1.01;
    const isDriving = () => app.session.phase !== "growing";

    function wanted() {
      const { session } = app;
      const [x, y] = isDriving() ? app.pose() : session.scenario.start;
      if (!isDriving()) return { x, y, half: Math.max(GROWING_VIEW, 1.7 * world().gridSize) };
      if (app.isFollowing) return { x, y, half: FOLLOWING_VIEW };
      return { x: 0, y: 0, half: wholeView() };
    }
    function moveCamera(seconds) {
      const to = wanted();
      const part = camera.half === 0 || app.isCalm ? 1 : 1 - Math.exp(-4 * seconds);
      for (const name of ["x", "y", "half"]) camera[name] += (to[name] - camera[name]) * part;
    }
    function trace() {
      const [x, y] = app.pose();
      trail.push(x, y);
      if (trail.length > 2 * TRAIL) trail.splice(0, 2);
    }

    // Pictures of light and flames that are painted once, since gradients are slow.
    const sprites = new Map();
    const clear = (color, alpha) => color.replace("rgb", "rgba").replace(")", `, ${alpha})`);
    function sprite(name, color, paint) {
      const key = `${name} ${color}`;
      if (!sprites.has(key)) {
        const picture = document.createElement("canvas");
        picture.width = SPRITE;
        picture.height = SPRITE;
        paint(picture.getContext("2d"), color);
        sprites.set(key, picture);
      }
      return sprites.get(key);
    }
    function paintGlow(context, color) {
      const half = SPRITE / 2, fill = context.createRadialGradient(half, half, 0, half, half, half);
      fill.addColorStop(0, color);
      fill.addColorStop(1, clear(color, 0));
      context.fillStyle = fill;
      context.fillRect(0, 0, SPRITE, SPRITE);
    }
    function paintFlame(context, color) {
      const fill = context.createLinearGradient(0, 0, 0, SPRITE);
      fill.addColorStop(0, clear(color, 0.75));
      fill.addColorStop(1, clear(color, 0));
      context.fillStyle = fill;
      context.beginPath();
      context.moveTo(0, 0);
      context.lineTo(SPRITE, 0);
      context.lineTo(SPRITE / 2, SPRITE);
      context.fill();
    }
    function glow(context, [x, y], radius, color, strength) {
      context.globalAlpha = strength;
      context.drawImage(sprite("glow", color, paintGlow), x - radius, -y - radius, 2 * radius, 2 * radius);
      context.globalAlpha = 1;
    }
    function drawTrail(context) {
      context.lineWidth = 0.7;
      const [r, g, b] = world().palette.tissue.match(/\d+/g);
      for (let from = 0; from + 2 < trail.length; from += 2 * TRAIL_PIECE) {
        context.strokeStyle = `rgba(${r}, ${g}, ${b}, ${(0.75 * from) / trail.length + 0.05})`;
        context.beginPath();
        context.moveTo(trail[from], -trail[from + 1]);
        const end = Math.min(from + 2 * TRAIL_PIECE, trail.length - 2);
        for (let i = from + 2; i <= end; i += 2) context.lineTo(trail[i], -trail[i + 1]);
        context.stroke();
      }
    }
    // Flames behind pushing wheels, and light around sensors, in the robot's frame with y down.
    function eachCell(visit) {
      const { body } = app.session, n = world().gridSize;
      const cells = [];
      for (const [character, cell] of Object.entries(world().cells)) cells[cell.code] = { ...cell, character };
      for (let i = 0; i < n * n; i++) {
        const cell = cells[body.data[i]];
        visit(cell, i, ((i % n) - (n - 1) / 2) * 2, (Math.floor(i / n) - (n - 1) / 2) * 2);
      }
    }
    function drawThrust(context) {
      const { palette } = world();
      eachCell((cell, i, x, y) => {
        const gas = Math.min(Math.max(app.session.gas[i], -1), 1);
        if (!cell.drives || Math.abs(gas) < 0.03) return;
        const flame = sprite("flame", gas > 0 ? palette.green : palette.vermilion, paintFlame);
        context.save();
        context.translate(x, y);
        context.scale(1, Math.sign(gas));
        context.drawImage(flame, -0.7, 0, 1.4, 1 + 4.5 * Math.abs(gas));
        context.restore();
      });
    }
    function drawSensing(context) {
      context.globalCompositeOperation = "lighter";
      eachCell((cell, i, x, y) => {
        if (!cell.senses) return;
        const hue = NCRSDrawing.sensorColor(cell.character);
        glow(context, [x, -y], 2.6, hue, 0.5 * app.session.sensed.data[i] ** 2);
      });
      context.globalCompositeOperation = "source-over";
    }
    function drawWall(context, ends) {
      context.fillStyle = world().palette.wall_edge;
      context.globalAlpha = 0.6;
      context.beginPath();
      NCRSLive.wallQuad(...ends).forEach(([x, y], i) => (i ? context.lineTo(x, -y) : context.moveTo(x, -y)));
      context.fill();
      context.globalAlpha = 1;
    }

    // An arrow at the edge of the picture towards a robot beyond it, with its distance from there.
    function pointOutwards(context, x, y) {
      const inset = 0.94 * camera.half, [dx, dy] = [x - camera.x, y - camera.y];
      const beyond = Math.max(Math.abs(dx), Math.abs(dy));
      if (beyond < camera.half) return;
      const size = camera.half / 30, at = inset / beyond;
      context.save();
      context.translate(camera.x + dx * at, -(camera.y + dy * at));
      context.fillStyle = world().palette.white;
      context.font = `600 ${1.3 * size}px system-ui, sans-serif`;
      context.textAlign = dx > 0.5 * beyond ? "right" : dx < -0.5 * beyond ? "left" : "center";
      context.fillText(`${(beyond - camera.half).toFixed(0)} away`, -Math.sign(dx) * size, Math.sign(dy) * 2.6 * size || 2.6 * size);
      context.rotate(Math.atan2(dx, dy));
      context.beginPath();
      context.moveTo(0, -size);
      context.lineTo(0.8 * size, size);
      context.lineTo(-0.8 * size, size);
      context.fill();
      context.restore();
    }

    function draw(seconds) {
      const { session } = app, side = canvas.clientWidth || 320;
      NCRSDrawing.world = world();
      moveCamera(seconds);
      const context = NCRSDrawing.surface(canvas, side);
      context.translate(side / 2, side / 2);
      context.scale(side / (2 * camera.half), side / (2 * camera.half));
      context.translate(-camera.x, camera.y);
      NCRSDrawing.drawField(context, 4 * wholeView());
      NCRSDrawing.drawWalls(context, session.scenario.walls);
      const { light, target } = session.scenario;
      const ball = session.scenario.ball && app.ball();
      if (light) glow(context, light, 30, world().palette.amber, 0.5);
      if (ball) glow(context, ball, 9, world().palette.amber, 0.55);
      NCRSDrawing.drawGoals(context, { light, target }, ball);
      if (isDriving()) drawTrail(context);
      if (wall) drawWall(context, wall);
      const [x, y, angle] = isDriving() ? app.pose() : [...session.scenario.start, 0];
      context.save();
      context.translate(x, -y);
      context.rotate(-angle);
      if (isDriving()) drawThrust(context);
      const values = isDriving() ? session.sensed.data : null;
      NCRSDrawing.drawRobot(context, app.characters(), values, isDriving() ? session.gas : null);
      if (isDriving()) drawSensing(context);
      context.restore();
      pointOutwards(context, x, y);
    }

    function place(event) {
      const box = canvas.getBoundingClientRect(), scale = (2 * camera.half) / box.width;
      return [camera.x + (event.clientX - box.x - box.width / 2) * scale,
        camera.y - (event.clientY - box.y - box.height / 2) * scale];
    }
    const apart = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
    // What the pointer takes at a point: the light from anywhere, the ball and the target nearby.
    function grabbed(point) {
      if (!world().hasBall) return "light";
      const toBall = apart(point, app.ball()), toTarget = apart(point, app.session.scenario.target);
      if (Math.min(toBall, toTarget) > GRAB) return "target";
      return toBall < toTarget ? "ball" : "target";
    }
    function onDown(event) {
      if (!event.isPrimary || event.button > 0) return;
      canvas.focus({ preventScroll: true });
      try {
        canvas.setPointerCapture(event.pointerId);
      } catch (error) {
        if (error.name !== "NotFoundError") throw error; // a synthetic pointer cannot be captured
      }
      const point = place(event);
      app.touched();
      if (app.tool === "erase") app.eraseWall(point);
      else if (app.tool === "wall") wall = [point, point];
      else {
        held = grabbed(point);
        app.moveThing(held, point);
      }
      event.preventDefault();
    }
    function onMove(event) {
      if (!event.isPrimary) return;
      const point = place(event);
      if (wall) wall = [wall[0], point];
      else if (held) app.moveThing(held, point);
      else if (app.tool === "erase" && event.buttons) app.eraseWall(point);
    }
    function onUp(event) {
      if (!event.isPrimary) return;
      if (wall && event.type === "pointerup") app.addWall(...wall);
      wall = null;
      held = null;
    }
    canvas.addEventListener("pointerdown", onDown);
    canvas.addEventListener("pointermove", onMove);
    canvas.addEventListener("pointerup", onUp);
    canvas.addEventListener("pointercancel", onUp);
    return {
      draw, trace, isBusy: () => held !== null || wall !== null,
      forget: () => trail.splice(0),
    };
  };
})();
