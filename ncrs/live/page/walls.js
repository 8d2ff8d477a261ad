// Walls that are put into the playfield by hand: straight, as quads.
"use strict";

(() => {
  const HALF_WIDTH = 1.6; // units
  const MIN_LENGTH = 2;
  const MAX_WALLS = 60;

  // The corners of a wall between two points; a long side runs from the second to the third.
  NCRSLive.wallQuad = ([x0, y0], [x1, y1]) => {
    const length = Math.hypot(x1 - x0, y1 - y0) || 1;
    const [along, across] = [(HALF_WIDTH * (x1 - x0)) / length, (HALF_WIDTH * (y1 - y0)) / length];
    return [[x0 - across, y0 + along], [x0 + across, y0 - along], [x1 + across, y1 - along], [x1 - across, y1 + along]];
  };

  NCRSLive.isInside = ([x, y], quad) => {
    const sides = quad.map(([x0, y0], i) => {
      const [x1, y1] = quad[(i + 1) % quad.length];
      return (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0);
    });
    return sides.every((side) => side >= 0) || sides.every((side) => side <= 0);
  };

  // The distance of a point from the line between two others.
  function distance([x, y], [x0, y0], [x1, y1]) {
    const [dx, dy] = [x1 - x0, y1 - y0];
    const at = Math.min(Math.max(((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy || 1), 0), 1);
    return Math.hypot(x0 + at * dx - x, y0 + at * dy - y);
  }

  // A reason why no wall can stand between two points, or null.
  NCRSLive.wallRefusal = (session, from, to) => {
    if (session.world.hasBall) return "The ball's physics knows no walls; choose a robot that seeks a light.";
    if (Math.hypot(to[0] - from[0], to[1] - from[1]) < MIN_LENGTH) return "Drag from one end of the wall to the other.";
    if (session.scenario.walls.length >= MAX_WALLS) return `There is room for ${MAX_WALLS} pieces of wall; clear some first.`;
    const robot = session.phase === "growing" ? session.scenario.start : session.center();
    const reach = session.world.gridSize * Math.SQRT2 + HALF_WIDTH + 0.5;
    if (distance(robot, from, to) < reach) return "A wall cannot stand on the robot; leave it some room.";
    return null;
  };
})();
