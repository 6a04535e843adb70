/* A curve of a panel: its data, its look, and what is said of it. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const NEAR_PX = 14;

  function seriesOf(view, given, place, kind) {
    const set = given.set ? view.model.sets.get(given.set) : null;
    const data = view.model.data(given);
    return {
      ...given,
      ...data,
      place,
      middle: kind === "innovation" ? null : data.values, // of ±1σ: zero for innovations, else the estimate itself
      style: set ? set.style : (given.style ?? 0),
      marker: set ? set.marker : null,
      leads: Boolean(set && (set.role === "present" || set.role === "chosen")),
      spacing:
        data.times.length > 1
          ? (1.5 * (data.times[data.times.length - 1] - data.times[0])) / (data.times.length - 1)
          : 0,
    };
  }

  /* The sample of a series that is meant at a moment, where a pixel is so many seconds; -1 where there is none near. */
  function sampleAt(series, t, pixel) {
    const i = viewer.nearest(series.times, t);
    if (i < 0) return -1;
    const away = Math.abs(series.times[i] - t);
    return away <= Math.max(NEAR_PX * pixel, series.spacing) && !Number.isNaN(series.values[i]) ? i : -1;
  }

  /* A sample in words: of an innovation how many standard deviations it is, of an estimate how well it is known. */
  function toldSample({ values, sigma, rejected }, i, { kind, unit }) {
    const { withUnit, figure } = viewer.words;
    const out = rejected && rejected[i] ? " rejected" : "";
    const told = withUnit(values[i], unit);
    if (!sigma || !(sigma[i] > 0)) return told + out;
    if (kind !== "innovation") return `${told} ± ${figure(sigma[i])}${out}`;
    const share = (values[i] / sigma[i]).toFixed(1).replace("-0.0", "0.0").replace("-", "−");
    return `${told} (${share} σ)${out}`;
  }

  /* What a panel shows, for those who do not see it. */
  function describedPanel(panel, shown) {
    const { figure, withUnit } = viewer.words;
    const parts = shown.map((series) => {
      const found = viewer.summary(series);
      const lost = rejectedOf(series, found);
      const reach = `${series.label}: from ${figure(found.least)} to ${withUnit(found.most, panel.unit)}`;
      return lost ? `${reach}, ${lost}` : reach;
    });
    return `${panel.title} over time. ${parts.join("; ")}.`;
  }

  /* The figures of a panel: of what is in view the extremes, of all how much was rejected. */
  function figuresOf({ model, axis }, panel, shown) {
    const { figure } = viewer.words;
    const at = (t) => (Number.isNaN(t) ? "–" : model.moment(t));
    const rows = shown.map((series) => {
      const seen = viewer.summary(series, axis.from, axis.to);
      const lost = rejectedOf(series, viewer.summary(series)) || "–";
      return [series.label, figure(seen.least), at(seen.leastAt), figure(seen.most), at(seen.mostAt), lost];
    });
    const about = `${panel.title}${panel.unit ? `, ${panel.unit}` : ""}: `;
    const head = ["", "smallest", "when", "largest", "when", "rejected, whole flight"];
    return viewer.table(head, rows, about + (axis.isWhole() ? "the whole flight" : "what is in view"));
  }

  /* Share of all samples where the data count them, else how many are marked; nothing of what no gate judges. */
  function rejectedOf({ rejected, samples, rejected_samples: lost }, found) {
    if (lost === 0) return "none rejected";
    if (lost) return `${viewer.words.share(lost, samples)} rejected`;
    return rejected ? `${found.rejected} marked as rejected` : "";
  }

  Object.assign(viewer, { seriesOf, sampleAt, toldSample, describedPanel, figuresOf });
})();
