// What translated functions call: arrays of several axes, Python's operators, and tiles.
"use strict";

// An array of several axes: its numbers row by row, and its shape.
const newGrid = (Store, shape) => ({ data: new Store(shape.reduce((a, b) => a * b)), shape });
const flat = (array) => (array.data === undefined ? array : array.data);

// The part of an array at an index of its first axis; both share their numbers.
function part(array, index) {
  const shape = array.shape.slice(1);
  const size = shape.reduce((a, b) => a * b);
  const data = array.data.subarray(index * size, (index + 1) * size);
  return shape.length === 1 ? data : { data, shape };
}

function filled(array, value) {
  flat(array).fill(value);
  return array;
}

function zerosLike(array) {
  const data = new (flat(array).constructor)(flat(array).length);
  return array.data === undefined ? data : { data, shape: array.shape };
}

// As Python and numba compare, also with NaN and signed zeros.
const minimum = (a, b) => (b < a ? b : a);
const maximum = (a, b) => (b > a ? b : a);
const modulo = (a, b) => a - b * Math.floor(a / b);
const copySign = (size, sign) =>
  (sign < 0 || Object.is(sign, -0) ? -Math.abs(size) : Math.abs(size));

// The first of the largest values.
function indexOfMax(values) {
  let best = 0;
  for (let i = 1; i < values.length; i++) if (values[i] > values[best]) best = i;
  return best;
}

// Tiles, as in ncrs/engines/tiles.py: rows x lanes float32 values. A kernel holds at most one tile
// of a size at a time, so each size needs memory once. Products and sums fuse: in float64 the
// product of two float32 values is exact, and Math.fround rounds the sum. Memory of float64 spares
// a conversion for each. A factor of zero changes nothing but the sign of a zero, since weights are
// finite.
const tileMemory = new Map();

function repeatRow(rows, lanes, array, offset) {
  const key = 1024 * rows + lanes;
  let tile = tileMemory.get(key);
  if (tile === undefined) {
    tile = { rows, lanes, values: new Float64Array(rows * lanes) };
    tileMemory.set(key, tile);
  }
  for (let row = 0; row < rows; row++) {
    for (let lane = 0; lane < lanes; lane++) tile.values[row * lanes + lane] = array[offset + lane];
  }
  return tile;
}

function addOuterProduct(tile, weights, start, inputs, first, stride) {
  const { rows, lanes, values } = tile;
  for (let row = 0; row < rows; row++) {
    const input = inputs[first + row * stride], at = row * lanes;
    if (input === 0) continue;
    for (let lane = 0; lane < lanes; lane += 4) { // sizes are multiples of 4; four at once are faster
      const to = at + lane, from = start + lane;
      const a = Math.fround(values[to] + weights[from] * input);
      const b = Math.fround(values[to + 1] + weights[from + 1] * input);
      const c = Math.fround(values[to + 2] + weights[from + 2] * input);
      const d = Math.fround(values[to + 3] + weights[from + 3] * input);
      values[to] = a;
      values[to + 1] = b;
      values[to + 2] = c;
      values[to + 3] = d;
    }
  }
  return tile;
}

function storeRectified(tile, array, first, stride) {
  const { rows, lanes, values } = tile;
  for (let row = 0; row < rows; row++) {
    for (let lane = 0; lane < lanes; lane++) {
      const value = values[row * lanes + lane];
      array[first + row * stride + lane] = value < 0 ? 0 : value;
    }
  }
}

function storeClippedSum(tile, limit, inputs, outputs, first, stride) {
  const { rows, lanes, values } = tile;
  for (let row = 0; row < rows; row++) {
    for (let lane = 0; lane < lanes; lane++) {
      const at = first + row * stride + lane;
      let total = Math.fround(inputs[at] + values[row * lanes + lane]);
      if (total > limit) total = limit;
      if (total < -limit) total = -limit;
      outputs[at] = total;
    }
  }
}
