/* Buttons of the time axis, what is in view in words, and what mouse and keys do. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const HELP = [
    ["Drag", "zoom to a part of the flight"],
    ["Double click, Esc or 0", "back to the flight as it was at first"],
    ["Ctrl and wheel, pinch, + and −", "zoom"],
    ["Shift and wheel, Shift and ← →", "pan"],
    ["Point at something, ← →", "move the cursor: its figures stand in every panel"],
    ["One finger across", "move the cursor"],
  ];

  viewer.makeToolbar = (view) => {
    const { model, axis } = view;
    const { h } = viewer;
    const button = (label, text, act) =>
      h("button", { type: "button", "aria-label": label, title: label, onclick: act }, text);
    const range = h("span", { class: "fv-window" });
    const cursor = h("span", { class: "fv-cursor" });
    const whole = button("Whole flight", "whole", () => axis.showWhole());
    const air =
      model.takeoff !== null
        ? button("in the air", "in the air", () => axis.setWindow(model.takeoff, model.landing ?? model.stop))
        : null;
    const help = h(
      "dl",
      { class: "fv-help" },
      HELP.map(([what, does]) => [h("dt", {}, what), h("dd", {}, does)]),
    );
    const shut = viewer.discloser("?", help, { className: "fv-help-button" });
    shut.button.setAttribute("aria-label", "What mouse, fingers and keys do");
    const element = h(
      "div",
      { class: "fv-toolbar", role: "group", "aria-label": "Time axis" },
      h(
        "span",
        { class: "fv-buttons" },
        button("Earlier", "◂", () => axis.pan(-0.5)),
        button("Later", "▸", () => axis.pan(0.5)),
        button("Closer", "+", () => axis.zoom(0.5)),
        button("Wider", "−", () => axis.zoom(2)),
        whole,
        air,
        shut.button,
      ),
      h("span", { class: "fv-told" }, range, cursor),
      help,
    );
    return {
      element,
      tell() {
        const digits = axis.to - axis.from < 2 ? 3 : 1;
        const ends = [axis.from, axis.to].map((t) => viewer.words.seconds(t - model.origin, digits));
        range.textContent = axis.isWhole()
          ? `the whole log, ${viewer.words.seconds(model.stop - model.start, 1)}`
          : `${ends[0]} to ${ends[1]}${model.takeoff === null ? " of the log" : " after take-off"}`;
        cursor.textContent = axis.cursor === null ? "" : view.telling(axis.cursor, axis.to - axis.from < 2 ? 4 : 2);
        whole.disabled = axis.isWhole();
      },
    };
  };
})();
