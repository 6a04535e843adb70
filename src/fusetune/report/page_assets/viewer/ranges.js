/* How far up and down the scale of a panel reaches. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const LOG_SPAN = 1e5;
  const PADDING = 0.06;
  const MOST_BEYOND = 3;

  /* By what of the shown series is in view, with their standard deviations (or gates), as far as these leave the curve
     to be seen, and the limit where it is near. */
  function rangeOf(view, panel, shown, bounded, log) {
    const { model, axis } = view;
    const [from, to] = model.counts(axis.from, axis.to);
    const [least, most] = viewer.extremes(shown.flatMap((series) => seenOf(series, from, to, log)));
    if (least > most) return log ? [0.01, 1] : [-1, 1];
    const limit = panel.limit ?? null;
    if (log) {
      const top = Math.max(most, limit || 0) * 1.3;
      return [Math.max(Math.min(least, top / 100), top / LOG_SPAN), top];
    }
    let [low, high] = [least, most];
    for (const series of bounded) {
      const [lowest, highest] = boundsOf(series, from, to, view.showsGate() ? series.gate || 1 : 1);
      const far = Math.max(-lowest, highest) > MOST_BEYOND * Math.max(Math.abs(least), Math.abs(most));
      if (panel.kind === "innovation" && far && !view.showsGate()) continue;
      [low, high] = [Math.min(low, lowest), Math.max(high, highest)];
    }
    if (panel.kind === "ratio") low = Math.min(low, 0);
    if (limit !== null && limit < MOST_BEYOND * high) high = Math.max(high, limit);
    const pad = PADDING * (high - low) || PADDING * Math.abs(high) || 1;
    return [low - (panel.kind === "ratio" && low === 0 ? 0 : pad), high + pad];
  }

  /* Smallest and largest value between two times, neighbours included; on a logarithmic axis of those above zero. */
  function seenOf({ times, values }, from, to, log) {
    const [first, last] = viewer.within(times, from, to);
    const seen = values.subarray(first, last + 1);
    return viewer.extremes(log ? seen.filter((value) => value > 0) : seen).filter(Number.isFinite);
  }

  /* How far so many standard deviations reach down and up between two times; nowhere where none is known. */
  function boundsOf({ times, sigma, middle }, from, to, factor) {
    const [first, last] = viewer.within(times, from, to);
    let [least, most] = [Infinity, -Infinity];
    for (let i = first; i <= last; i += 1) {
      const at = middle ? middle[i] : 0;
      if (at - factor * sigma[i] < least) least = at - factor * sigma[i];
      if (at + factor * sigma[i] > most) most = at + factor * sigma[i];
    }
    return [least, most];
  }

  viewer.rangeOf = rangeOf;
})();
