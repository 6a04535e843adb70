/* What pointer, wheel and fingers do on anything that has the time axis. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const PER_PIXEL = 0.0022;
  const LINE_PX = 16;

  /* Ctrl and wheel (or a pinch on a touch pad) zoom, shift and wheel (or a sideways swipe) pan. The wheel alone scrolls
     the page. With fingers: one across moves the cursor, two zoom and pan, one up or down scrolls the page.
     `timeAt(clientX)` in s of the log; `widthOf()` of the time axis in pixels. */
  viewer.addGestures = (element, axis, timeAt, widthOf, { cursor = true } = {}) => {
    element.addEventListener(
      "wheel",
      (event) => {
        const unit = event.deltaMode === 1 ? LINE_PX : 1;
        const across = event.shiftKey && !event.deltaX ? event.deltaY : event.deltaX;
        if (event.ctrlKey || event.metaKey) axis.zoom(Math.exp(event.deltaY * unit * PER_PIXEL), timeAt(event.clientX));
        else if (Math.abs(across) > Math.abs(event.shiftKey ? 0 : event.deltaY)) axis.pan((across * unit) / widthOf());
        else return;
        event.preventDefault();
      },
      { passive: false },
    );

    element.addEventListener("dblclick", () => axis.reset());

    const fingers = new Map();
    const spread = () => {
      const [a, b] = [...fingers.values()];
      return { middle: (a + b) / 2, apart: Math.max(Math.abs(a - b), 20) };
    };
    element.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "mouse") return;
      fingers.set(event.pointerId, event.clientX);
      if (fingers.size === 1 && cursor) axis.setCursor(timeAt(event.clientX));
    });
    element.addEventListener("pointermove", (event) => {
      if (!fingers.has(event.pointerId)) return;
      if (fingers.size === 1) {
        if (cursor) axis.setCursor(timeAt(event.clientX));
        fingers.set(event.pointerId, event.clientX);
        return;
      }
      const before = spread();
      fingers.set(event.pointerId, event.clientX);
      const now = spread();
      axis.zoom(before.apart / now.apart, timeAt(now.middle));
      axis.shift(timeAt(before.middle) - timeAt(now.middle));
    });
    for (const end of ["pointerup", "pointercancel", "pointerleave"]) {
      element.addEventListener(end, (event) => fingers.delete(event.pointerId));
    }
  };

  /* Keys, wherever the focus is in the viewer, but not where something is written or chosen. */
  viewer.addKeys = (element, axis) => {
    const acts = {
      ArrowLeft: (event) => (event.shiftKey ? axis.pan(-0.1) : axis.step(-0.01)),
      ArrowRight: (event) => (event.shiftKey ? axis.pan(0.1) : axis.step(0.01)),
      "+": () => axis.zoom(0.5),
      "=": () => axis.zoom(0.5),
      "-": () => axis.zoom(2),
      0: () => axis.reset(),
      Escape: () => axis.reset(),
    };
    element.addEventListener("keydown", (event) => {
      const act = acts[event.key];
      if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.target.closest("select, input, textarea")) return;
      event.preventDefault();
      act(event);
    });
  };
})();
