/* What stands on the map beside the track; `to` takes metres east and north to pixels. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const SCALES = [1, 2, 5];

  function line(context, to, { north, east }, first, last) {
    context.beginPath();
    let open = false;
    for (let i = first; i <= last; i += 1) {
      const is = !Number.isNaN(north[i]);
      if (is) context[open ? "lineTo" : "moveTo"](to.x(east[i]), to.y(north[i]));
      open = is;
    }
    context.stroke();
  }

  function drawMission(context, to, mission, colours) {
    if (!mission.length) return;
    context.strokeStyle = context.fillStyle = colours.quiet;
    context.lineWidth = 1.25;
    context.setLineDash([6, 5]);
    context.beginPath();
    mission.forEach(([north, east], i) => context[i ? "lineTo" : "moveTo"](to.x(east), to.y(north)));
    context.stroke();
    context.setLineDash([]);
    for (const [north, east] of mission) {
      context.beginPath();
      context.arc(to.x(east), to.y(north), 2.5, 0, 2 * Math.PI);
      context.fill();
    }
  }

  function drawFixes(context, to, gnss, axis, colours) {
    if (!gnss) return;
    const [first, last] = viewer.within(gnss.time, axis.from, axis.to);
    context.fillStyle = colours.quiet;
    for (let i = first; i <= last; i += 1) {
      if (!Number.isNaN(gnss.north[i])) context.fillRect(to.x(gnss.east[i]) - 1, to.y(gnss.north[i]) - 1, 2, 2);
    }
  }

  function drawStart(context, to, track, colours) {
    const i = track.north.findIndex((value, at) => !Number.isNaN(value) && track.time[at] >= track.begins);
    if (i < 0) return;
    context.beginPath();
    context.arc(to.x(track.east[i]), to.y(track.north[i]), 4.5, 0, 2 * Math.PI);
    context.fillStyle = colours.ground;
    context.strokeStyle = colours.ink;
    context.lineWidth = 2;
    context.fill();
    context.stroke();
  }

  function roundLength(most) {
    const power = 10 ** Math.floor(Math.log10(most));
    return power * SCALES.filter((factor) => factor * power <= most).pop();
  }

  function drawGrid(context, to, width, height, colours) {
    const step = roundLength(Math.max(90 / to.scale, 1e-3)) * to.scale;
    context.strokeStyle = colours.line;
    context.lineWidth = 1;
    context.beginPath();
    for (let x = ((to.x(0) % step) + step) % step; x < width; x += step) {
      context.moveTo(Math.round(x) + 0.5, 0);
      context.lineTo(Math.round(x) + 0.5, height);
    }
    for (let y = ((to.y(0) % step) + step) % step; y < height; y += step) {
      context.moveTo(0, Math.round(y) + 0.5);
      context.lineTo(width, Math.round(y) + 0.5);
    }
    context.stroke();
  }

  function drawScaleBar(context, scale, width, height, colours) {
    const metres = roundLength(Math.max(90 / scale, 1e-3));
    const long = metres * scale;
    const text = metres >= 1000 ? `${metres / 1000} km` : `${Number(metres.toPrecision(1))} m`;
    context.fillStyle = colours.ground;
    context.globalAlpha = 0.8;
    context.fillRect(6, height - 26, long + 20, 22);
    context.globalAlpha = 1;
    context.strokeStyle = context.fillStyle = colours.ink;
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(12, height - 13);
    context.lineTo(12, height - 8);
    context.lineTo(12 + long, height - 8);
    context.lineTo(12 + long, height - 13);
    context.stroke();
    context.textAlign = "center";
    context.textBaseline = "bottom";
    context.font = "12px system-ui, sans-serif";
    context.fillText(text, 12 + long / 2, height - 10);
  }

  function drawNorth(context, width, colours) {
    context.save();
    context.translate(width - 18, 24);
    context.fillStyle = colours.ink;
    context.beginPath();
    [
      [0, -14],
      [5, 2],
      [0, -2],
      [-5, 2],
    ].forEach(([x, y]) => context.lineTo(x, y));
    context.fill();
    context.textAlign = "center";
    context.textBaseline = "top";
    context.font = "12px system-ui, sans-serif";
    context.fillText("N", 0, 4);
    context.restore();
  }

  viewer.onMap = { line, drawMission, drawFixes, drawStart, drawGrid, drawScaleBar, drawNorth };
})();
