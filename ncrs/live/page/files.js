// Genomes from files, which are read and checked here: .npy, .npz and .json.
"use strict";

(() => {
  const MAX_BYTES = 32e6;
  const FORMAT = 1; // of the .npz that NCRS writes
  const text = (raw) => new TextDecoder().decode(raw);

  class FileError extends Error {}
  const refuse = (reason) => { throw new FileError(reason); };

  // An array of numbers out of numpy's format, with its shape.
  function readNpy(raw) {
    const view = new DataView(raw.buffer, raw.byteOffset, raw.byteLength);
    if (raw.length < 12 || text(raw.subarray(1, 6)) !== "NUMPY" || raw[0] !== 0x93) refuse("it is not a numpy file");
    const isLong = raw[6] > 1;
    const start = isLong ? 12 : 10, length = isLong ? view.getUint32(8, true) : view.getUint16(8, true);
    if (start + length > raw.length) refuse("its header is cut off");
    const header = text(raw.subarray(start, start + length));
    const descr = /'descr':\s*'([<>|=][a-z]\d+)'/.exec(header), shape = /'shape':\s*\(([\d\s,]*)\)/.exec(header);
    if (!descr || !shape || !/'fortran_order':\s*(True|False)/.test(header)) refuse("its header is none of an array of numbers");
    const sides = shape[1].split(",").filter((side) => side.trim()).map(Number);
    const count = sides.reduce((a, b) => a * b, 1);
    const order = descr[1][0] !== ">", kind = descr[1].slice(1);
    const reader = { f4: "getFloat32", f8: "getFloat64", i1: "getInt8", i2: "getInt16", i4: "getInt32", u1: "getUint8" }[kind];
    if (!reader) refuse(`it holds ${kind}, and weights are f4 or f8`);
    const size = Number(kind.slice(1)), from = start + length;
    if (from + count * size !== raw.length) refuse("its size is not the one that its header declares");
    return { shape: sides, values: Float64Array.from({ length: count }, (_, i) => view[reader](from + i * size, order)) };
  }

  function checksum(raw) {
    let sum = ~0;
    for (const byte of raw) {
      sum ^= byte;
      for (let bit = 0; bit < 8; bit++) sum = (sum >>> 1) ^ (sum & 1 ? 0xedb88320 : 0);
    }
    return ~sum >>> 0;
  }

  // The members of a zip file, by name, each with its checksum verified.
  async function readZip(raw) {
    const view = new DataView(raw.buffer, raw.byteOffset, raw.byteLength);
    let end = raw.length - 22;
    while (end >= 0 && view.getUint32(end, true) !== 0x06054b50) end -= 1;
    if (end < 0) refuse("it is not a whole zip file");
    const members = new Map();
    let at = view.getUint32(end + 16, true);
    for (let i = view.getUint16(end + 10, true); i > 0; i--) {
      if (at + 46 > raw.length || view.getUint32(at, true) !== 0x02014b50) refuse("its table of contents is damaged");
      const method = view.getUint16(at + 10, true), sum = view.getUint32(at + 16, true);
      const packed = view.getUint32(at + 20, true), size = view.getUint32(at + 24, true);
      const lengths = [28, 30, 32].map((offset) => view.getUint16(at + offset, true));
      const local = view.getUint32(at + 42, true), name = text(raw.subarray(at + 46, at + 46 + lengths[0]));
      if (size > MAX_BYTES || local + 30 > raw.length) refuse("a part of it is damaged or too large");
      const from = local + 30 + view.getUint16(local + 26, true) + view.getUint16(local + 28, true);
      let content = raw.subarray(from, from + packed);
      if (method === 8) content = await NCRSLive.inflate(content).catch(() => refuse("a part of it is damaged"));
      else if (method !== 0) refuse("it is compressed in an unknown way");
      if (content.length !== size || checksum(content) !== sum) refuse(`${name} does not have its checksum`);
      members.set(name.replace(/\.npy$/, ""), content);
      at += 46 + lengths[0] + lengths[1] + lengths[2];
    }
    return members;
  }

  // A champion's file, or the only array of a foreign one.
  async function readNpz(raw) {
    const members = await readZip(raw);
    if (!members.has("json")) {
      if (members.size !== 1) refuse(`it holds ${members.size} arrays, and none says which is the genome`);
      return { genome: readNpy(members.values().next().value) };
    }
    const stored = parse(text(Uint8Array.from(readNpy(members.get("json")).values)));
    if (stored.format !== FORMAT) refuse(`it has the format ${JSON.stringify(stored.format)}; this page reads ${FORMAT}`);
    const { state } = stored, array = state?.genome?.__array__;
    if (state && "archive" in state) refuse("it holds an archive; write a page of its elites with: ncrs live RUN --elites 50");
    if (!members.has(array)) refuse("it holds no champion");
    return { ...record(state.task ?? {}, state), genome: readNpy(members.get(array)) };
  }

  function parse(content) {
    try {
      return JSON.parse(content);
    } catch {
      return refuse("it is not valid JSON");
    }
  }
  const record = (task, known) => ({
    task: task.name, gridSize: task.grid_size, distanceScore: task.distance_score, successRadius: task.success_radius,
    fitness: known.fitness, success: known.success,
  });

  function readJson(raw) {
    const stored = parse(text(raw));
    if (!stored || typeof stored !== "object" || !Array.isArray(stored.genome)) refuse("it lacks the list of weights, \"genome\"");
    return { ...record({ ...stored, name: stored.task }, stored), genome: { shape: [stored.genome.length], values: stored.genome } };
  }

  const finite = (value) => (typeof value === "number" && Number.isFinite(value) ? value : NaN);

  // Check what a file or a link holds, and make it a robot of the page.
  NCRSLive.checkRobot = (found, worlds, current) => {
    const { shape, values } = found.genome;
    const lengths = Object.fromEntries(Object.entries(worlds).map(([name, sizes]) => [name, Object.values(sizes)[0].parameters]));
    if (shape.length !== 1) refuse(`a genome is a vector, this is an array of ${shape.length} axes`);
    const fits = Object.keys(lengths).filter((name) => lengths[name] === values.length);
    if (!fits.length) refuse(`a genome has ${[...new Set(Object.values(lengths))].join(" or ")} weights, this one ${values.length}`);
    if (found.task !== undefined && !fits.includes(found.task)) refuse("its task is not one of this page, or its genome has another length");
    const genome = Float32Array.from(values, (value) => (typeof value === "number" ? value : NaN));
    if (!genome.every(Number.isFinite)) refuse("its weights must be finite float32 numbers");
    const task = found.task ?? (fits.includes(current) ? current : fits[0]);
    const known = worlds[task], gridSize = found.gridSize ?? Number(Object.keys(known)[0]);
    if (!Object.hasOwn(known, gridSize)) refuse(`its grid size must be one of ${Object.keys(known).join(", ")}`);
    const { distanceScore, successRadius } = known[gridSize];
    const radius = found.successRadius ?? successRadius, score = found.distanceScore ?? distanceScore;
    if (!(finite(radius) > 0)) refuse("its success radius must be a positive number");
    if (!["exponential", "inverse_square"].includes(score)) refuse("its distance score is unknown");
    return {
      task, gridSize, genome, title: String(found.title ?? "your genome").slice(0, 80),
      note: String(found.note ?? "").slice(0, 200), fitness: finite(found.fitness), success: finite(found.success),
      successRadius: radius, distanceScore: score, isOwn: true,
    };
  };

  NCRSLive.readRobot = async (file, worlds, current) => {
    const suffix = /\.(npy|npz|json)$/i.exec(file.name)?.[1].toLowerCase();
    try {
      if (!suffix) refuse("give a .npz, .npy or .json");
      if (file.size > MAX_BYTES) refuse("it is too large for a genome");
      const raw = new Uint8Array(await file.arrayBuffer());
      const found = await { npy: async () => ({ genome: readNpy(raw) }), npz: () => readNpz(raw), json: async () => readJson(raw) }[suffix]();
      return NCRSLive.checkRobot({ ...found, title: file.name.replace(/\.\w+$/, "") }, worlds, current);
    } catch (error) {
      if (error instanceof FileError || error instanceof RangeError) throw new Error(`${file.name.slice(0, 80)} cannot be used: ${error.message}.`);
      throw error;
    }
  };
})();
