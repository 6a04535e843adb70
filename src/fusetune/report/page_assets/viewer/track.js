/* The track of a flight as the map needs it: its sets, fixes, mission and manoeuvres, and how far it reaches. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const LEAST_M = 4;
  const NEAR_PX = 30;

  function readTrack(model) {
    if (!model.track) return null;
    const read = (from, prefix = "") =>
      Object.fromEntries(
        ["time", "north", "east", "height", "heading"].map((name) => [name, model.array(from[prefix + name])]),
      );
    const track = {
      ...read(model.track),
      manoeuvres: model.track.manoeuvres || [],
      mission: model.track.mission || [],
    };
    track.gnss =
      model.track.gnss_time === undefined || model.track.gnss_time === null ? null : read(model.track, "gnss_");
    track.sets = Object.entries(model.track.sets || {}).map(([name, own]) => [name, read(own)]);
    track.heading = track.heading || new Float32Array(track.time.length).fill(NaN);
    const all = [track, ...(track.gnss ? [track.gnss] : [])];
    // on the ground, where nothing is known yet, an estimate may be anywhere
    const flown = (one, name) => {
      const seen = one[name].filter((_, i) => model.isFlown(one.time[i]));
      return viewer.extremes(seen.length ? seen : one[name]);
    };
    const bounds = (name, more) => viewer.extremes([...all.flatMap((one) => flown(one, name)), ...more]);
    const [south, north] = bounds(
      "north",
      track.mission.map((place) => place[0]),
    );
    const [west, east] = bounds(
      "east",
      track.mission.map((place) => place[1]),
    );
    if (!(north >= south)) return null;
    track.box = {
      north: (north + south) / 2,
      east: (east + west) / 2,
      high: Math.max(north - south, LEAST_M),
      wide: Math.max(east - west, LEAST_M),
    };
    [track.lowest, track.highest] = flown(track, "height");
    track.kindAt = kindsAt(track);
    track.begins = model.takeoff ?? model.start;
    return track;
  }

  /* Which manoeuvre each place of the track belongs to, -1 for none. */
  function kindsAt({ time, manoeuvres }) {
    const found = new Int32Array(time.length).fill(-1);
    manoeuvres.forEach(([t0, t1], k) => {
      for (let i = viewer.firstFrom(time, t0); i < time.length && time[i] < t1; i += 1) found[i] = k;
    });
    return found;
  }

  /* The place of the track next to a pixel, of those in view; -1 where none is near. */
  function nearestOnTrack(track, to, x, y, axis) {
    const [first, last] = viewer.within(track.time, axis.from, axis.to);
    let [best, least] = [-1, NEAR_PX ** 2];
    for (let i = first; i <= last; i += 1) {
      const away = (to.x(track.east[i]) - x) ** 2 + (to.y(track.north[i]) - y) ** 2;
      if (away < least) [best, least] = [i, away];
    }
    return best;
  }

  function describedTrack(track) {
    const [high, wide, lowest, highest] = [track.box.high, track.box.wide, track.lowest, track.highest].map(
      viewer.words.figure,
    );
    return (
      `Track from above: ${high} m from south to north, ${wide} m from west to east, ` +
      `between ${lowest} and ${highest} m high.`
    );
  }

  Object.assign(viewer, { readTrack, nearestOnTrack, describedTrack });
})();
