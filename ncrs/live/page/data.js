// What the page holds: worlds by task and grid size, robots, and their genomes.
"use strict";

const NCRSLive = (() => {
  const { bytes, base64 } = NCRSPage;

  async function through(raw, stream) {
    const piped = new Blob([raw]).stream().pipeThrough(stream);
    return new Uint8Array(await new Response(piped).arrayBuffer());
  }
  const inflate = (raw) => through(raw, new DecompressionStream("deflate-raw"));
  const deflate = (raw) => through(raw, new CompressionStream("deflate-raw"));

  // The genome's weights, from little-endian bytes.
  function weights(raw) {
    const view = new DataView(raw.buffer, raw.byteOffset, raw.byteLength);
    return Float32Array.from({ length: raw.byteLength / 4 }, (_, i) => view.getFloat32(4 * i, true));
  }

  async function load() {
    const stored = JSON.parse(document.getElementById("data").textContent);
    const content = JSON.parse(new TextDecoder().decode(await inflate(bytes(stored.content))));
    const genomes = await inflate(bytes(stored.genomes));
    let at = 0;
    for (const robot of content.robots) {
      const size = 4 * content.worlds[robot.task][robot.gridSize].parameters;
      robot.genome = weights(genomes.subarray(at, at + size));
      at += size;
    }
    return content;
  }

  return { load, inflate, deflate, weights, bytes, base64 };
})();
