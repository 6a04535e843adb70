/* The one time axis of panels, strip and map: what is in view, and where the cursor stands. Seconds of the log. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const SHORTEST_S = 0.02;

  viewer.makeTimeAxis = ({ start, stop, home }) => {
    const listeners = [];
    const axis = { start, stop, from: home[0], to: home[1], cursor: null };
    const tell = (what) => listeners.forEach((listener) => listener(what));
    const shortest = Math.min(SHORTEST_S, stop - start);

    axis.subscribe = (listener) => listeners.push(listener);
    axis.isWhole = () => axis.from === start && axis.to === stop;
    axis.isHome = () => Math.abs(axis.from - home[0]) < 1e-6 && Math.abs(axis.to - home[1]) < 1e-6;

    axis.setWindow = (from, to) => {
      const length = Math.min(Math.max(to - from, shortest), stop - start);
      const middle = (from + to) / 2;
      const first = Math.min(Math.max(to - from < length ? middle - length / 2 : from, start), stop - length);
      if (first === axis.from && first + length === axis.to) return;
      axis.from = first;
      axis.to = length === stop - start ? stop : first + length;
      tell("window");
    };
    axis.reset = () => axis.setWindow(...home);
    axis.showWhole = () => axis.setWindow(start, stop);
    axis.pan = (share) => axis.shift(share * (axis.to - axis.from));
    axis.shift = (by) => axis.setWindow(axis.from + by, axis.to + by);
    /* Makes the window `factor` times as long; the moment `about` stays where it is. */
    axis.zoom = (factor, about = axis.centre()) => {
      const length = Math.min((axis.to - axis.from) * factor, stop - start);
      const share = (about - axis.from) / (axis.to - axis.from);
      axis.setWindow(about - share * length, about - share * length + length);
    };
    axis.centre = () => {
      const within = axis.cursor !== null && axis.cursor >= axis.from && axis.cursor <= axis.to;
      return within ? axis.cursor : (axis.from + axis.to) / 2;
    };
    axis.setCursor = (t) => {
      const to = t === null ? null : Math.min(Math.max(t, start), stop);
      if (to === axis.cursor) return;
      axis.cursor = to;
      tell("cursor");
    };
    /* By keyboard: the window follows the cursor. */
    axis.step = (share) => {
      const length = axis.to - axis.from;
      const t = Math.min(Math.max((axis.cursor === null ? axis.from : axis.cursor) + share * length, start), stop);
      if (t < axis.from) axis.setWindow(t, t + length);
      if (t > axis.to) axis.setWindow(t - length, t);
      axis.setCursor(t);
    };
    /* Shows a finding with some of what was before and after it. */
    axis.jump = (t0, t1) => {
      const around = Math.max(0.25 * (t1 - t0), 1);
      axis.setWindow(t0 - around, t1 + around);
      axis.setCursor(Math.max(t0, start));
    };
    return axis;
  };
})();
