// Colours of numbers, on the scales that come with the data: one for amounts, one for signed values.
"use strict";

// What pages draw with; world is the task on show, as ncrs/live/world.py describes it.
const NCRSDrawing = { world: null };

(() => {
  const scale = (name) => NCRSDrawing.world.scales[name];

  function between(stops, fraction) {
    const at = Math.min(Math.max(fraction, 0), 1) * (stops.length - 1);
    const low = Math.min(Math.floor(at), stops.length - 2);
    return stops[low].map((value, i) => Math.round(value + (stops[low + 1][i] - value) * (at - low)));
  }
  const text = (rgb) => `rgb(${rgb.join(", ")})`;

  // Colour of a value from low to high.
  NCRSDrawing.amountColor = (value, low, high) =>
    text(between(scale("amount"), high > low ? (value - low) / (high - low) : 0));
  // Colour of a signed value; beyond the limit it no longer changes.
  NCRSDrawing.signedRgb = (value) =>
    between(scale("signed"), 0.5 + (0.5 * value) / NCRSDrawing.world.signedLimit);
  NCRSDrawing.signedColor = (value) => text(NCRSDrawing.signedRgb(value));
  // Background that shows a whole scale, "amount" or "signed", from left to right.
  NCRSDrawing.ramp = (name) =>
    `linear-gradient(to right, ${scale(name).map((rgb) => `rgb(${rgb.join(", ")})`).join(", ")})`;
})();
