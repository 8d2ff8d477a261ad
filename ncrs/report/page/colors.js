// Colour scales that remain readable with colour-blindness: viridis for amounts, blue to orange
// around zero for the automaton's channels.
"use strict";

(() => {
  const AMOUNTS = [
    [68, 1, 84], [71, 45, 123], [59, 82, 139], [44, 114, 142], [33, 145, 140],
    [40, 174, 128], [94, 201, 98], [173, 220, 48], [253, 231, 37],
  ];
  const SIGNED = [[8, 64, 129], [67, 147, 195], [247, 247, 247], [241, 150, 70], [127, 59, 8]];

  function between(stops, share) {
    const at = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
    const low = Math.min(Math.floor(at), stops.length - 2);
    const rgb = stops[low].map((value, i) => Math.round(value + (stops[low + 1][i] - value) * (at - low)));
    return `rgb(${rgb.join(", ")})`;
  }

  function ramp(stops) {
    return `linear-gradient(to right, ${stops.map((rgb) => `rgb(${rgb.join(", ")})`).join(", ")})`;
  }

  // Colour of a value from low to high.
  NCRSReport.amountColor = (value, low, high) =>
    between(AMOUNTS, high > low ? (value - low) / (high - low) : 0.5);
  // Colour of a value from -limit to limit.
  NCRSReport.signedColor = (value, limit) =>
    between(SIGNED, limit > 0 ? 0.5 + (0.5 * value) / limit : 0.5);
  NCRSReport.amountRamp = ramp(AMOUNTS);
  NCRSReport.signedRamp = ramp(SIGNED);
})();
