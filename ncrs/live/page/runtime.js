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
// product of two float32 values is exact, and Math.fround rounds the sum. The products are noted
// first and added when the tile is stored, eight lanes at once, which keeps the sums in registers;
// every sum takes them in the same order. A factor of zero changes nothing but the sign of a zero,
// since weights are finite.
const MAX_PRODUCTS = 1024;
const tileMemory = new Map();

function repeatRow(rows, lanes, array, offset) {
  const key = 1024 * rows + lanes;
  let tile = tileMemory.get(key);
  if (tile === undefined) {
    tile = {
      rows, lanes, values: new Float64Array(rows * lanes), weights: array, count: new Int32Array(rows),
      factors: new Float64Array(rows * MAX_PRODUCTS), starts: new Int32Array(rows * MAX_PRODUCTS),
    };
    tileMemory.set(key, tile);
  }
  tile.count.fill(0);
  for (let row = 0; row < rows; row++) {
    for (let lane = 0; lane < lanes; lane++) tile.values[row * lanes + lane] = array[offset + lane];
  }
  return tile;
}

function addOuterProduct(tile, weights, start, inputs, first, stride) {
  tile.weights = weights;
  for (let row = 0; row < tile.rows; row++) {
    const factor = inputs[first + row * stride];
    if (factor === 0) continue;
    const at = row * MAX_PRODUCTS + tile.count[row];
    tile.factors[at] = factor;
    tile.starts[at] = start;
    tile.count[row] += 1;
  }
  return tile;
}

function addUp(tile) {
  const { rows, lanes, values, weights, factors, starts } = tile, round = Math.fround;
  for (let row = 0; row < rows; row++) {
    const begin = row * MAX_PRODUCTS, end = begin + tile.count[row];
    for (let lane = 0; lane < lanes; lane += 8) { // sizes are multiples of 8
      const to = row * lanes + lane;
      let a = values[to], b = values[to + 1], c = values[to + 2], d = values[to + 3];
      let e = values[to + 4], f = values[to + 5], g = values[to + 6], h = values[to + 7];
      for (let i = begin; i < end; i++) {
        const factor = factors[i], from = starts[i] + lane;
        a = round(a + weights[from] * factor);
        b = round(b + weights[from + 1] * factor);
        c = round(c + weights[from + 2] * factor);
        d = round(d + weights[from + 3] * factor);
        e = round(e + weights[from + 4] * factor);
        f = round(f + weights[from + 5] * factor);
        g = round(g + weights[from + 6] * factor);
        h = round(h + weights[from + 7] * factor);
      }
      values[to] = a;
      values[to + 1] = b;
      values[to + 2] = c;
      values[to + 3] = d;
      values[to + 4] = e;
      values[to + 5] = f;
      values[to + 6] = g;
      values[to + 7] = h;
    }
  }
}

function storeRectified(tile, array, first, stride) {
  addUp(tile);
  const { rows, lanes, values } = tile;
  for (let row = 0; row < rows; row++) {
    for (let lane = 0; lane < lanes; lane++) {
      const value = values[row * lanes + lane];
      array[first + row * stride + lane] = value < 0 ? 0 : value;
    }
  }
}

function storeClippedSum(tile, limit, inputs, outputs, first, stride) {
  addUp(tile);
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
