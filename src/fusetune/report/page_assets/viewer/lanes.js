/* Canvases whose time axis lies under that of the panels, so that what stands below each other was at the same time. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const GUTTER = { left: 58, right: 14 };
  const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif";

  /* A canvas that is drawn anew when its width changes. `draw(context, width, height)` works in CSS pixels. */
  function makeCanvas(height, draw) {
    const element = viewer.h("canvas", { class: "fv-canvas" });
    const context = element.getContext("2d");
    let width = 0;
    function resize(to) {
      width = to;
      const scale = globalThis.devicePixelRatio || 1;
      element.width = Math.round(width * scale);
      element.height = Math.round(made.height * scale);
      element.style.width = `${width}px`;
      element.style.height = `${made.height}px`;
      context.setTransform(scale, 0, 0, scale, 0, 0);
      made.redraw();
    }
    const made = {
      element,
      height,
      resize,
      width: () => width,
      redraw() {
        if (!width) return;
        context.clearRect(0, 0, width, made.height);
        context.font = FONT;
        draw(context, width, made.height);
      },
    };
    return made;
  }

  /* Seconds to pixels and back, on a canvas so wide. */
  function scaleOf(from, to, width) {
    const left = GUTTER.left;
    const right = width - GUTTER.right;
    return {
      left,
      right,
      x: (t) => left + ((t - from) / (to - from)) * (right - left),
      t: (x) => from + ((x - left) / (right - left)) * (to - from),
    };
  }

  /* Pixels [x0, x1] of a span that are in view, at least `least` of them; null where none are. */
  function visible(scale, t0, t1, least = 2) {
    const x0 = Math.max(scale.x(t0), scale.left);
    const x1 = Math.min(scale.x(t1), scale.right);
    if (x1 < scale.left || x0 > scale.right) return null;
    return [Math.min(x0, scale.right - least), Math.max(x1, Math.min(x0, scale.right - least) + least)];
  }

  /* A text within a width, shortened where it is longer; nothing where not even three letters fit. */
  function fitted(context, text, width) {
    if (context.measureText(text).width <= width) return text;
    for (let length = text.length - 1; length >= 3; length -= 1) {
      const shorter = `${text.slice(0, length).trimEnd()}…`;
      if (context.measureText(shorter).width <= width) return shorter;
    }
    return "";
  }

  function cursorLine(context, scale, t, height, colour) {
    if (t === null) return;
    const x = Math.round(scale.x(t)) + 0.5;
    if (x < scale.left || x > scale.right) return;
    context.strokeStyle = colour;
    context.lineWidth = 1;
    context.setLineDash([]);
    context.beginPath();
    context.moveTo(x, 0);
    context.lineTo(x, height);
    context.stroke();
  }

  Object.assign(viewer, { GUTTER, makeCanvas, scaleOf, visible, fitted, cursorLine });
})();
