// What all pages share: elements, and bytes as text.
"use strict";

const NCRSPage = (() => {
  function bytes(text) {
    return Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  }

  function base64(raw) {
    const parts = [];
    for (let i = 0; i < raw.length; i += 8192) parts.push(String.fromCharCode(...raw.subarray(i, i + 8192)));
    return btoa(parts.join(""));
  }

  // An element with attributes and children; text is never read as HTML.
  function element(tag, attributes = {}, ...children) {
    const svg = ["svg", "path", "line", "text", "g", "circle"].includes(tag);
    const made = svg
      ? document.createElementNS("http://www.w3.org/2000/svg", tag)
      : document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
      if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
      else if (value === true) made.setAttribute(name, "");
      else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value);
    }
    made.append(...children.filter((child) => child !== null));
    return made;
  }

  return { bytes, base64, element };
})();
