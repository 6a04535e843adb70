/* How figures and times are told. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const MINUTES_FROM_S = 600;

  const signed = (text) => text.replace(/^-/, "−").replace(/e([+-])/, (_, sign) => (sign === "-" ? "e−" : "e"));

  /* Four significant digits, as many as the data hold. */
  function figure(value) {
    if (value === null || value === undefined || Number.isNaN(value)) return "–";
    const size = Math.abs(value);
    if (size >= 1e4 && size < 1e7) return signed(String(Number(value.toPrecision(4))));
    if (size !== 0 && size < 1e-4) return signed(value.toExponential(3));
    return value === 0 ? "0" : signed(value.toPrecision(4));
  }

  function tick(value) {
    const size = Math.abs(value);
    if (size !== 0 && (size >= 1e5 || size < 1e-4)) return signed(value.toExponential(1).replace(".0e", "e"));
    return signed(String(Number(value.toPrecision(6))));
  }

  function withUnit(value, unit) {
    const text = figure(value);
    return unit && text !== "–" ? `${text} ${unit}` : text;
  }

  function seconds(s, digits) {
    if (Math.abs(s) < MINUTES_FROM_S) return `${signed(s.toFixed(digits))} s`;
    const minutes = Math.floor(s / 60);
    return `${minutes} min ${(s - 60 * minutes).toFixed(digits)} s`;
  }

  /* A moment, counted from take-off where the log has one. */
  function moment(t, takeoff, digits = 1) {
    if (takeoff === null || takeoff === undefined) return `${seconds(t, digits)} after the log began`;
    const since = t - takeoff;
    return since < -0.5 * 10 ** -digits
      ? `${seconds(-since, digits)} before take-off`
      : `${seconds(Math.abs(since), digits)} after take-off`;
  }

  function span(t0, t1, takeoff) {
    const lasts = t1 - t0;
    return lasts < 0.05 ? moment(t0, takeoff) : `${moment(t0, takeoff)}, ${seconds(lasts, 1)} long`;
  }

  function share(part, whole) {
    const percent = (100 * part) / whole;
    return part > 0 && percent < 0.1 ? "less than 0.1 %" : `${percent.toFixed(1)} %`;
  }

  /* As a heading begins; what begins with a Greek letter or an abbreviation stays. */
  const heading = (text) => (/^[a-z]+\b/.test(text) ? text[0].toUpperCase() + text.slice(1) : text);

  viewer.words = { heading, figure, tick, withUnit, seconds, moment, span, share, MINUTES_FROM_S };
})();
