/* Series with times of their own on one time axis, as uPlot takes them. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const LOG_FLOOR = 1e-9; // zero has no place on a logarithmic axis

  /* [times, values of the first series, …]: undefined where a series has no sample, null where its sample is NaN.
     `places[k]` says where sample i of series k went. */
  viewer.joined = (all, { log = false } = {}) => {
    const distinct = [...new Set(all.map((data) => data.times))];
    const times = union(distinct);
    const where = new Map(distinct.map((own) => [own, placesIn(times, own)]));
    const columns = all.map((data) => {
      const column = new Array(times.length);
      const places = where.get(data.times);
      for (let i = 0; i < data.values.length; i += 1) {
        const value = data.values[i];
        column[places[i]] = Number.isNaN(value) ? null : log ? Math.max(value, LOG_FLOOR) : value;
      }
      return column;
    });
    return { columns: [times, ...columns], places: all.map((data) => where.get(data.times)) };
  };

  function union(distinct) {
    if (distinct.length === 1) return distinct[0];
    const together = new Float64Array(distinct.reduce((sum, own) => sum + own.length, 0));
    let at = 0;
    for (const own of distinct) {
      together.set(own, at);
      at += own.length;
    }
    together.sort();
    let kept = 0;
    for (let i = 0; i < together.length; i += 1) {
      if (!i || together[i] !== together[kept - 1]) together[kept++] = together[i];
    }
    return together.slice(0, kept);
  }

  function placesIn(times, own) {
    const places = new Uint32Array(own.length);
    let at = 0;
    for (let i = 0; i < own.length; i += 1) {
      while (times[at] < own[i]) at += 1;
      places[i] = at;
    }
    return places;
  }
})();
