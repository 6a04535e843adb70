/* A flight as it is looked at: its panels in groups, its sets, and what stands in them. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const ROLES = {
    present: "flies now",
    chosen: "chosen",
    ruled_out: "ruled out",
    onboard: "logged",
    as_flown: "as it flew",
  };

  /* First place in a sorted array whose value is not below `t`. */
  function firstFrom(times, t) {
    let low = 0;
    let high = times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] < t) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  function nearest(times, t) {
    const after = firstFrom(times, t);
    if (after === 0) return times.length ? 0 : -1;
    if (after === times.length) return after - 1;
    return times[after] - t < t - times[after - 1] ? after : after - 1;
  }

  /* Places [first, last] of what a line from `from` to `to` needs: with one neighbour on either side. */
  function within(times, from, to) {
    return [Math.max(firstFrom(times, from) - 1, 0), Math.min(firstFrom(times, to), times.length - 1)];
  }

  /* When the first of what is shown was: some logs say that they began minutes before anything was written. */
  function beginning({ takeoff_s: takeoff, bands = [], panels = [], track }, array) {
    const first = [takeoff ?? Infinity, ...bands.flatMap((band) => band.spans.map((span) => span[0]))];
    if (track) first.push(array(track.time)[0] ?? Infinity);
    for (const panel of panels)
      first.push(...panel.series.slice(0, 1).map((series) => array(series.time)[0] ?? Infinity));
    const found = Math.min(...first);
    return Number.isFinite(found) ? Math.max(found, 0) : 0;
  }

  viewer.makeModel = ({ header, array }) => {
    const stop = Math.max(header.duration_s, 0.1);
    const sets = new Map((header.sets || []).map((set) => [set.name, set]));
    const start = Math.min(beginning(header, array), stop - 0.1);
    const model = {
      header,
      name: header.flight,
      label: header.label || header.flight,
      takeoff: header.takeoff_s ?? null,
      landing: header.landing_s ?? null,
      start,
      stop,
      sets,
      panels: header.panels || [],
      bands: header.bands || [],
      marks: [...(header.marks || [])].sort((a, b) => a.t0 - b.t0),
      events: [...(header.events || [])].sort((a, b) => a.t - b.t),
      track: header.track || null,
      array: (index) => (index === null || index === undefined ? null : array(index)),
    };
    /* Where figures begin to count on an axis: at take-off. */
    model.origin = model.takeoff ?? 0;
    model.moment = (t, digits) => viewer.words.moment(t, model.takeoff, digits);
    model.span = (t0, t1) => viewer.words.span(t0, t1, model.takeoff);
    model.groups = [...new Set(model.panels.map((panel) => panel.group))];
    if (model.bands.length && !model.groups.includes("Flags")) model.groups.push("Flags");

    const labels = new Map(
      model.panels
        .flatMap((panel) => panel.series)
        .reverse()
        .map((series) => [series.set, series.label]),
    );
    model.labelOf = (name) => labels.get(name) || name;
    model.roleOf = (name) => ROLES[sets.get(name)?.role] || "";
    /* What is shown until the reader chooses: what flies now and what was chosen. */
    model.usualSets = () => {
      const all = [...sets.values()];
      const usual = all.filter((set) => set.role === "present" || set.role === "chosen");
      return (usual.length ? usual : all.slice(0, 1)).map((set) => set.name);
    };
    model.airTime = () => (model.landing ?? stop) - (model.takeoff ?? start);
    model.isFlown = (t) => t >= (model.takeoff ?? start) && t <= (model.landing ?? stop);
    /* What is in view at first: the flight with some of what was before and after it, where the log is much longer. */
    const around = Math.max(0.1 * model.airTime(), 3);
    const flown = [
      Math.max((model.takeoff ?? start) - around, start),
      Math.min((model.landing ?? stop) + around, stop),
    ];
    model.home = flown[1] - flown[0] > 0.6 * (stop - start) ? [start, stop] : flown;
    /* What of a window counts for the scale of a panel: the part in the air, unless there is hardly any. On the ground
       the filter aligns, and what it says then would press the flight flat. */
    model.counts = (from, to) => {
      const [first, last] = [Math.max(from, model.takeoff ?? start), Math.min(to, model.landing ?? stop)];
      return last - first >= 0.2 * (to - from) ? [first, last] : [from, to];
    };
    model.data = (series) => ({
      times: model.array(series.time),
      values: model.array(series.value),
      sigma: model.array(series.sigma),
      rejected: model.array(series.rejected),
    });
    model.height = (t) => {
      if (!model.track) return NaN;
      const at = nearest(model.array(model.track.time), t);
      return at < 0 ? NaN : model.array(model.track.height)[at];
    };
    model.bandAt = (id, t) => {
      const band = model.bands.find((one) => one.id === id);
      const span = band && band.spans.find(([t0, t1]) => t >= t0 && t < t1);
      return span ? span[2] : "";
    };
    return model;
  };

  /* Smallest and largest value of a series, when they were, and how much of it was rejected. */
  viewer.summary = ({ times, values, rejected }, from = -Infinity, to = Infinity) => {
    const found = { count: 0, rejected: 0, least: NaN, leastAt: NaN, most: NaN, mostAt: NaN, last: NaN };
    for (let i = 0; i < times.length; i += 1) {
      const value = values[i];
      if (times[i] < from || times[i] > to || Number.isNaN(value)) continue;
      found.count += 1;
      if (rejected && rejected[i]) found.rejected += 1;
      if (!(value >= found.least)) [found.least, found.leastAt] = [value, times[i]];
      if (!(value <= found.most)) [found.most, found.mostAt] = [value, times[i]];
      found.last = value;
    }
    return found;
  };

  /* Of figures, NaN among them. */
  function extremes(values) {
    let [least, most] = [Infinity, -Infinity];
    for (const value of values) {
      if (value < least) least = value;
      if (value > most) most = value;
    }
    return [least, most];
  }

  Object.assign(viewer, { firstFrom, nearest, within, extremes });
})();
