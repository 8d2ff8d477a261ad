// Line charts of the run's curves by generation.
"use strict";

(() => {
  const { element } = NCRSReport;
  const WIDTH = 300, HEIGHT = 150, LEFT = 38, RIGHT = 6, TOP = 6, BOTTOM = 20;
  const COLORS = ["var(--line-1)", "var(--line-2)", "var(--line-3)"];
  const DASHES = ["none", "6 3", "2 3"]; // lines differ by more than colour

  // About four round numbers between low and high.
  function ticks(low, high) {
    if (high <= low) return [low];
    const raw = (high - low) / 4;
    const power = 10 ** Math.floor(Math.log10(raw));
    const step = power * [1, 2, 2.5, 5, 10].find((factor) => factor * power >= raw);
    const found = [];
    for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) found.push(i * step);
    return found;
  }

  function label(value) {
    return Number(value.toPrecision(4)).toLocaleString("en");
  }

  function chart({ title, lines }) {
    const xs = lines.flatMap((line) => line.x), ys = lines.flatMap((line) => line.y);
    const x0 = Math.min(...xs), x1 = Math.max(...xs, x0 + 1);
    let y0 = Math.min(...ys), y1 = Math.max(...ys);
    if (y1 - y0 < 1e-6) { y0 = Math.min(y0, 0); y1 = Math.max(y1, y0 + 1); }
    const px = (x) => LEFT + ((x - x0) / (x1 - x0)) * (WIDTH - LEFT - RIGHT);
    const py = (y) => HEIGHT - BOTTOM - ((y - y0) / (y1 - y0)) * (HEIGHT - TOP - BOTTOM);
    const svg = element("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, "aria-hidden": "true" });
    for (const y of ticks(y0, y1)) {
      svg.append(
        element("line", { class: "axis", x1: LEFT, x2: WIDTH - RIGHT, y1: py(y), y2: py(y) }),
        element("text", { x: LEFT - 5, y: py(y) + 4, "text-anchor": "end" }, label(y)),
      );
    }
    for (const x of ticks(x0, x1).filter(Number.isInteger)) {
      const anchor = px(x) > WIDTH - 20 ? "end" : "middle";
      svg.append(element("text", { x: px(x), y: HEIGHT - 5, "text-anchor": anchor }, label(x)));
    }
    const key = element("ul", { class: "key" });
    lines.forEach((line, i) => {
      const points = line.x.map((x, j) => `${px(x).toFixed(1)},${py(line.y[j]).toFixed(1)}`);
      const style = `stroke: ${COLORS[i]}; stroke-dasharray: ${DASHES[i]}`;
      svg.append(element("path", { d: `M${points.join("L")}`, style }));
      key.append(element("li", {},
        element("svg", { viewBox: "0 0 22 8", "aria-hidden": "true" },
          element("path", { d: "M0,4H22", style })),
        line.name,
        element("b", { title: "last value" }, line.y[line.y.length - 1].toFixed(4))));
    });
    return element("figure", { class: "chart" },
      element("h3", {}, title), svg,
      element("figcaption", {}, element("span", { class: "quiet" }, "by generation; last values:"), key));
  }

  NCRSReport.showCharts = () => {
    const place = document.getElementById("charts");
    for (const each of NCRSReport.overview.charts) place.append(chart(each));
  };
})();
