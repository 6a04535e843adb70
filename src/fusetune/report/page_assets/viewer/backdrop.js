/* What lies under and over the lines of a panel: ground, findings, bounds, limit; rejected samples, markers, events. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const MARKER_EVERY_PX = 110;
  const MARKER_PX = 4;
  const CROSS_PX = 3.5;
  const MOST_EVENTS = 20; // in view: more hide what they are about; the strip has them all
  const MOST_TINTED = 0.6; // of the flight: a finding about all of it tints nothing

  /* Draws in pixels of the canvas, within the plot. */
  function within(u, draw) {
    const context = u.ctx;
    const { left, top, width, height } = u.bbox;
    context.save();
    context.beginPath();
    context.rect(left, top, width, height);
    context.clip();
    draw(context, globalThis.devicePixelRatio || 1, {
      left,
      top,
      width,
      height,
      right: left + width,
      bottom: top + height,
    });
    context.restore();
  }

  const xOf = (u, t) => u.valToPos(t, "x", true);
  const yOf = (u, value) => u.valToPos(value, "y", true);

  /* Under the lines. `bounded` are the series whose bounds are shown. */
  function drawUnder(u, view, panel, bounded) {
    const { model, colours } = view;
    within(u, (context, dpr, box) => {
      context.fillStyle = colours.sunk;
      for (const [t0, t1] of onGround(model)) fillSpan(context, u, box, t0, t1);
      for (const mark of model.marks) {
        if (mark.t1 - mark.t0 > MOST_TINTED * model.airTime()) continue;
        context.fillStyle = colours.severity[mark.severity] || colours.quiet;
        context.globalAlpha = 0.1;
        fillSpan(context, u, box, mark.t0, mark.t1, 2 * dpr);
      }
      context.globalAlpha = 1;
      for (const series of bounded) drawBounds(context, u, series, colours.set[series.style % viewer.STYLES], dpr);
      if (panel.limit !== null && panel.limit !== undefined) {
        context.strokeStyle = colours.bad;
        context.lineWidth = 1.25 * dpr;
        context.setLineDash([6 * dpr, 4 * dpr]);
        horizontal(context, box, yOf(u, panel.limit));
        context.setLineDash([]);
      }
    });
  }

  /* Before take-off and after landing. */
  function onGround(model) {
    const spans = [];
    if (model.takeoff !== null) spans.push([model.start, model.takeoff]);
    if (model.landing !== null) spans.push([model.landing, model.stop]);
    return spans;
  }

  function fillSpan(context, u, box, t0, t1, least = 0) {
    const x0 = Math.max(xOf(u, t0), box.left);
    const x1 = Math.min(Math.max(xOf(u, t1), xOf(u, t0) + least), box.right);
    if (x1 > x0) context.fillRect(x0, box.top, x1 - x0, box.height);
  }

  function horizontal(context, box, y) {
    context.beginPath();
    context.moveTo(box.left, y);
    context.lineTo(box.right, y);
    context.stroke();
  }

  /* ±1σ as a shade around zero, or around an estimate, the gate as dashed lines. */
  function drawBounds(context, u, { times, sigma, gate, middle }, colour, dpr) {
    const y = (i, factor) => yOf(u, (middle ? middle[i] : 0) + factor * sigma[i]);
    const [first, last] = viewer.within(times, u.scales.x.min, u.scales.x.max);
    for (const [i0, i1] of runs(sigma, first, last)) {
      context.beginPath();
      for (let i = i0; i <= i1; i += 1) context.lineTo(xOf(u, times[i]), y(i, 1));
      for (let i = i1; i >= i0; i -= 1) context.lineTo(xOf(u, times[i]), y(i, -1));
      context.closePath();
      context.fillStyle = colour;
      context.globalAlpha = 0.14;
      context.fill();
      context.globalAlpha = 0.85;
      if (!gate) continue;
      context.strokeStyle = colour;
      context.lineWidth = dpr;
      context.setLineDash([4 * dpr, 4 * dpr]);
      for (const sign of [1, -1]) {
        context.beginPath();
        for (let i = i0; i <= i1; i += 1) context.lineTo(xOf(u, times[i]), y(i, sign * gate));
        context.stroke();
      }
      context.setLineDash([]);
    }
    context.globalAlpha = 1;
  }

  /* Pieces without NaN. */
  function runs(values, first, last) {
    const found = [];
    let begun = -1;
    for (let i = first; i <= last + 1; i += 1) {
      const is = i <= last && !Number.isNaN(values[i]);
      if (is && begun < 0) begun = i;
      if (!is && begun >= 0) {
        found.push([begun, i - 1]);
        begun = -1;
      }
    }
    return found;
  }

  /* Over the lines. `several` sets: then markers tell them apart without their colours. */
  function drawOver(u, view, shown, several) {
    const { model, colours } = view;
    within(u, (context, dpr, box) => {
      for (const series of shown) {
        const colour = colours.set[series.style % viewer.STYLES];
        context.strokeStyle = context.fillStyle = colour;
        if (several && series.marker) drawMarkers(context, u, series, box, dpr);
        if (series.rejected) drawRejected(context, u, series, colours.bad, dpr);
      }
      context.fillStyle = colours.quiet;
      const seen = model.events.filter(({ t }) => t >= u.scales.x.min && t <= u.scales.x.max);
      for (const event of seen.length > MOST_EVENTS ? [] : seen) {
        const x = xOf(u, event.t);
        context.beginPath();
        context.moveTo(x - 4 * dpr, box.top);
        context.lineTo(x + 4 * dpr, box.top);
        context.lineTo(x, box.top + 6 * dpr);
        context.fill();
      }
    });
  }

  function drawMarkers(context, u, { times, values, marker, place }, box, dpr) {
    context.lineWidth = 1.5 * dpr;
    const step = MARKER_EVERY_PX * dpr;
    for (let x = box.left + ((step * (0.3 + 0.17 * place)) % step); x < box.right; x += step) {
      const t = u.posToVal((x - box.left) / dpr, "x");
      const i = viewer.nearest(times, t);
      if (i < 0 || Number.isNaN(values[i]) || Math.abs(xOf(u, times[i]) - x) > step / 3) continue;
      viewer.drawMarker(context, marker, xOf(u, times[i]), yOf(u, values[i]), MARKER_PX * dpr);
    }
  }

  function drawRejected(context, u, { times, values, rejected }, colour, dpr) {
    const [first, last] = viewer.within(times, u.scales.x.min, u.scales.x.max);
    const size = CROSS_PX * dpr;
    context.strokeStyle = colour;
    context.lineWidth = 1.5 * dpr;
    context.beginPath();
    for (let i = first; i <= last; i += 1) {
      if (!rejected[i] || Number.isNaN(values[i])) continue;
      const [x, y] = [xOf(u, times[i]), yOf(u, values[i])];
      context.moveTo(x - size, y - size);
      context.lineTo(x + size, y + size);
      context.moveTo(x - size, y + size);
      context.lineTo(x + size, y - size);
    }
    context.stroke();
  }

  Object.assign(viewer, { drawUnder, drawOver });
})();
