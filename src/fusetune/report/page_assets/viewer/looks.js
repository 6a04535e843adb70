/* Colours, as the style sheet has them now, and the markers of the sets. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const NAMES = ["ground", "raised", "sunk", "line", "line-strong", "ink", "quiet", "accent", "bad", "warn"];
  const SEVERITIES = ["fail", "warning", "note", "pass"];
  const COLOURS = 8;
  const MANOEUVRES = 6;
  const HEIGHTS = 4;
  /* Outlines around 0, 0 in a square from -1 to 1; lines where they are not closed. */
  const OUTLINES = {
    square: [
      [
        [-0.85, -0.85],
        [0.85, -0.85],
        [0.85, 0.85],
        [-0.85, 0.85],
      ],
    ],
    diamond: [
      [
        [0, -1.1],
        [1.1, 0],
        [0, 1.1],
        [-1.1, 0],
      ],
    ],
    triangle: [
      [
        [0, -1],
        [1, 0.8],
        [-1, 0.8],
      ],
    ],
    down: [
      [
        [0, 1],
        [1, -0.8],
        [-1, -0.8],
      ],
    ],
    plus: [
      [
        [-1, 0],
        [1, 0],
      ],
      [
        [0, -1],
        [0, 1],
      ],
    ],
    cross: [
      [
        [-0.8, -0.8],
        [0.8, 0.8],
      ],
      [
        [-0.8, 0.8],
        [0.8, -0.8],
      ],
    ],
    star: [star()],
  };

  function star() {
    return Array.from({ length: 10 }, (_, i) => {
      const size = i % 2 ? 0.5 : 1.2;
      return [size * Math.sin((i * Math.PI) / 5), -size * Math.cos((i * Math.PI) / 5)];
    });
  }

  function readColours() {
    const css = fusetune.css;
    const found = { set: [], severity: {}, manoeuvre: [], height: [] };
    for (const name of NAMES) found[name] = css(`--${name}`);
    for (let k = 0; k < COLOURS; k += 1) found.set.push(css(`--set-${k}`));
    for (const name of SEVERITIES) found.severity[name] = css(`--mark-${name}`);
    for (let k = 0; k < MANOEUVRES; k += 1) found.manoeuvre.push(css(`--fv-manoeuvre-${k}`));
    for (let k = 0; k < HEIGHTS; k += 1) found.height.push(css(`--fv-height-${k}`));
    return found;
  }

  /* Between the colours of a scale; `share` from 0 to 1. */
  function onScale(scale, share) {
    const at = Math.min(Math.max(share, 0), 1) * (scale.length - 1);
    const low = Math.min(Math.floor(at), scale.length - 2);
    const [a, b] = [channels(scale[low]), channels(scale[low + 1])];
    return `rgb(${a.map((value, i) => Math.round(value + (at - low) * (b[i] - value))).join(" ")})`;
  }

  function channels(hex) {
    return [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
  }

  function drawMarker(context, marker, x, y, size) {
    const outlines = OUTLINES[marker];
    context.beginPath();
    if (!outlines) context.arc(x, y, 0.9 * size, 0, 2 * Math.PI);
    for (const outline of outlines || []) {
      outline.forEach(([dx, dy], i) => context[i ? "lineTo" : "moveTo"](x + dx * size, y + dy * size));
      if (outline.length > 2) context.closePath();
    }
    if (outlines && outlines[0].length === 2) context.stroke();
    else context.fill();
  }

  /* The marker on a piece of line, for chips and legends; its colour follows the theme by its class. */
  function swatch(style, marker) {
    const { svg } = viewer;
    const outlines = OUTLINES[marker];
    const sign =
      marker === null
        ? []
        : outlines
          ? outlines.map((outline) =>
              svg(outline.length > 2 ? "polygon" : "polyline", {
                points: outline.map(([x, y]) => `${12 + 4.5 * x},${7 + 4.5 * y}`).join(" "),
                class: outline.length > 2 ? "fv-filled" : "fv-stroked",
              }),
            )
          : [svg("circle", { cx: 12, cy: 7, r: 4, class: "fv-filled" })];
    return svg(
      "svg",
      {
        class: `fv-swatch fv-set-${style % COLOURS}`,
        viewBox: "0 0 24 14",
        width: 24,
        height: 14,
        "aria-hidden": "true",
      },
      svg("line", { x1: 1, y1: 7, x2: 23, y2: 7, class: "fv-stroked" }),
      sign,
    );
  }

  Object.assign(viewer, { readColours, onScale, drawMarker, swatch, STYLES: COLOURS });
})();
