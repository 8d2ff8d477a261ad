// Data of the page. A page opened from disk cannot read other files, but it can load scripts: each
// data file is a script that calls NCRSReport.receive, and is loaded when it is first needed.
"use strict";

const NCRSReport = (() => {
  const { bytes, element } = NCRSPage;
  const MAX_KEPT = 8; // data files of each kind kept in memory
  const kept = { robots: new Map(), genomes: new Map() };
  const waiting = new Map();

  function receive(kind, index, value) {
    if (kind === "overview") {
      NCRSReport.start(value);
      return;
    }
    const done = waiting.get(`${kind}-${index}`);
    if (done) done(value);
  }

  // A promise of one data file's content.
  function load(kind, index) {
    const files = kept[kind];
    if (files.has(index)) {
      const found = files.get(index);
      files.delete(index); // the most recently used goes to the end
      files.set(index, found);
      return found;
    }
    const name = `${kind}-${index}`;
    const promise = new Promise((resolve, reject) => {
      const script = document.createElement("script");
      const end = () => { waiting.delete(name); script.remove(); };
      waiting.set(name, (value) => { end(); resolve(value); });
      script.onerror = () => {
        end();
        files.delete(index);
        reject(new Error(`data/${name}.js is missing; copy the report's folder as a whole.`));
      };
      script.src = `data/${name}.js`;
      document.head.append(script);
    });
    files.set(index, promise);
    if (files.size > MAX_KEPT) files.delete(files.keys().next().value);
    return promise;
  }

  // Little-endian integers in base64, scaled to numbers from -limit (or 0) to limit.
  function unpack(text, type, limit) {
    const raw = bytes(text);
    const [size, read] = {
      int8: [1, "getInt8"], uint8: [1, "getUint8"], int16: [2, "getInt16"], uint16: [2, "getUint16"],
    }[type];
    const maxInteger = type.startsWith("u") ? 256 ** size - 1 : 256 ** size / 2 - 1;
    const scale = limit === undefined ? 1 : limit / maxInteger;
    const view = new DataView(raw.buffer);
    return Float64Array.from({ length: raw.length / size }, (_, i) => view[read](i * size, true) * scale);
  }

  // The record of a robot with growth and episodes, or null if it was not recorded.
  async function record(robot) {
    const { first, chunk } = NCRSReport.overview.records;
    if (robot < first) return null;
    const at = robot - first;
    const robots = await load("robots", Math.floor(at / chunk));
    return decode(robots[at % chunk]);
  }

  function decode(stored) {
    const limits = NCRSReport.overview.limits;
    const states = (text) => unpack(text, "int8", limits.state);
    return {
      bodies: unpack(stored.bodies, "uint8"),
      states: states(stored.states),
      episodes: stored.episodes.map((episode) => ({
        position: unpack(episode.position, "int16", limits.position),
        angle: unpack(episode.angle, "int16", limits.angle),
        ball: episode.ball === undefined ? null : unpack(episode.ball, "int16", limits.position),
        sensors: unpack(episode.sensors, "uint8", limits.unit),
        gas: unpack(episode.gas, "int8", limits.unit),
        reward: unpack(episode.reward, "uint16", limits.unit),
        control: states(episode.control),
        fitness: episode.fitness,
        successStep: episode.successStep,
      })),
    };
  }

  // The bytes of a genome: little-endian float32.
  async function genome(robot) {
    const { first, chunk } = NCRSReport.overview.records;
    const at = robot - first;
    const genomes = await load("genomes", Math.floor(at / chunk));
    return bytes(genomes[at % chunk]);
  }

  function robotName(robot) {
    const [sensors, wheels, cells] = NCRSReport.overview.robots.measures[robot];
    const counted = (n, word) => `${n} ${word}${n === 1 ? "" : "s"}`;
    return `${counted(sensors, "sensor")}, ${counted(wheels, "wheel")}, ${counted(cells, "cell")}`;
  }

  function isChampion(robot) {
    return robot === NCRSReport.overview.robots.champion;
  }

  function say(text) {
    document.getElementById("status").textContent = text;
  }

  function complain(error) {
    const place = document.getElementById("problem");
    place.textContent = error.message;
    place.hidden = false;
  }

  return { ...NCRSDrawing, receive, record, genome, robotName, isChampion, element, say, complain };
})();
