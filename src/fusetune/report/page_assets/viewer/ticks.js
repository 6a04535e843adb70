/* Where the axes of a panel have their figures, and how these are written. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const INCREMENTS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600];
  const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif";

  /* Both axes, as uPlot takes them. */
  function axesOf(view, log) {
    const { model } = view;
    const grid = { stroke: () => view.colours.line, width: 1 };
    const common = { stroke: () => view.colours.quiet, grid, ticks: { ...grid, size: 4 }, font: FONT };
    return [
      {
        ...common,
        size: 26,
        gap: 3,
        space: 64,
        incrs: INCREMENTS,
        splits: splitsFrom(model.origin),
        values: (_, at) => at.map((t) => timeTick(t - model.origin, model)),
      },
      {
        ...common,
        size: viewer.GUTTER.left,
        gap: 4,
        space: 28,
        splits: log ? decades : undefined,
        values: (_, at) => at.map((value) => (value === null ? "" : viewer.words.tick(value))),
      },
    ];
  }

  /* Round figures since take-off, not since the log began. */
  function splitsFrom(origin) {
    return (_, __, least, most, step) => {
      const found = [];
      for (let k = Math.ceil((least - origin) / step - 1e-6); origin + k * step <= most + 1e-9; k += 1)
        found.push(origin + k * step);
      return found;
    };
  }

  /* Powers of ten; 2 and 5 between them where there is room. */
  function decades(_, __, least, most) {
    const factors = Math.log10(most / least) > 2 ? [1] : [1, 2, 5];
    const found = [];
    for (let power = Math.floor(Math.log10(least)); power <= Math.ceil(Math.log10(most)); power += 1) {
      found.push(...factors.map((factor) => factor * 10 ** power).filter((value) => value >= least && value <= most));
    }
    return found;
  }

  function timeTick(since, model) {
    const { tick, MINUTES_FROM_S } = viewer.words;
    const rounded = Math.round(since * 1e4) / 1e4;
    if (model.stop < MINUTES_FROM_S) return `${tick(rounded)} s`;
    const whole = Math.abs(rounded);
    const minutes = Math.floor(whole / 60);
    const rest = Math.round((whole - 60 * minutes) * 100) / 100;
    return `${rounded < 0 ? "−" : ""}${minutes}:${rest < 10 ? "0" : ""}${rest}`;
  }

  viewer.axesOf = axesOf;
})();
