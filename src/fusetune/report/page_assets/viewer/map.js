/* The track from above, both axes to one scale: north is up. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const MARGIN_PX = 26;
  const LEAST_M = 4;
  const NEAR_PX = 30;
  const SCALES = [1, 2, 5];
  const BY = { height: "height", manoeuvre: "manoeuvre", none: "one colour" };

  viewer.makeMap = (view, changed) => {
    const { model, axis } = view;
    const { h } = viewer;
    const track = readTrack(model);
    if (!track) return null;
    const sight = { zoom: 1, east: 0, north: 0 };
    const canvas = viewer.makeCanvas(300, draw);
    const kinds = [...new Set(track.manoeuvres.map((span) => span[2]))];
    const choices = Object.keys(BY).filter((by) => by !== "manoeuvre" || kinds.length);
    let by = choices[0];

    const colouring = h("select", { id: viewer.uniqueId("map"), onchange: () => changed(colouring.value) },
      choices.map((one) => h("option", { value: one }, BY[one])));
    const legend = h("div", { class: "fv-map-legend" });
    const plot = h("div", { class: "fv-plot fv-map", role: "img" }, canvas.element);
    const zoomBy = (factor) => {
      sight.zoom = Math.min(Math.max(sight.zoom * factor, 1), 200);
      if (sight.zoom === 1) sight.east = sight.north = 0;
      canvas.redraw();
    };
    const button = (label, text, act) => h("button", { type: "button", "aria-label": label, title: label, onclick: act }, text);
    const element = h("section", { class: "fv-panel fv-map-panel", "aria-label": "Map" },
      h("div", { class: "fv-panel-head" }, h("h4", {}, "Track from above"),
        h("label", { for: colouring.id, class: "fv-quiet" }, "colour: "), colouring),
      h("span", { class: "fv-map-buttons" }, button("Map closer", "+", () => zoomBy(1.6)),
        button("Map wider", "−", () => zoomBy(1 / 1.6)), button("Whole track", "⤢", () => zoomBy(1e-6))),
      plot, legend);

    function projection(width, height) {
      const { box } = track;
      const fit = Math.min((width - 2 * MARGIN_PX) / box.wide, (height - 2 * MARGIN_PX) / box.high);
      const scale = fit * sight.zoom;
      return {
        scale,
        x: (east) => width / 2 + (east - box.east - sight.east) * scale,
        y: (north) => height / 2 - (north - box.north - sight.north) * scale,
      };
    }

    function draw(context, width, height) {
      const { colours } = view;
      const to = projection(width, height);
      context.lineJoin = "round";
      drawGrid(context, to, width, height, colours);
      drawMission(context, to, track.mission, colours);
      drawFixes(context, to, track.gnss, axis, colours);
      for (const [name, own] of track.sets) {
        if (!view.isShown(name)) continue;
        const set = model.sets.get(name);
        context.strokeStyle = colours.set[(set ? set.style : 0) % viewer.STYLES];
        context.lineWidth = 1;
        line(context, to, own, 0, own.time.length - 1);
      }
      drawTrack(context, to, colours);
      drawStart(context, to, track, colours);
      drawVehicle(context, to, colours);
      drawScaleBar(context, to.scale, width, height, colours);
      drawNorth(context, width, colours);
    }

    function drawTrack(context, to, colours) {
      const [first, last] = viewer.within(track.time, axis.from, axis.to);
      context.lineCap = "round";
      context.strokeStyle = colours["line-strong"];
      context.lineWidth = 1.5;
      if (!axis.isWhole()) line(context, to, track, 0, track.time.length - 1);
      context.lineWidth = 3;
      let i = first;
      while (i < last) {
        const colour = colourAt(i, colours);
        let end = i + 1;
        while (end < last && colourAt(end, colours) === colour) end += 1;
        context.strokeStyle = colour;
        line(context, to, track, i, end);
        i = end;
      }
    }

    function colourAt(i, colours) {
      if (by === "height") {
        const share = (track.height[i] - track.lowest) / (track.highest - track.lowest || 1);
        return viewer.onScale(colours.height, Math.round(share * 24) / 24);
      }
      if (by === "manoeuvre") {
        const kind = track.kindAt[i];
        return kind < 0 ? colours["line-strong"] : colours.manoeuvre[kinds.indexOf(track.manoeuvres[kind][2]) % colours.manoeuvre.length];
      }
      return colours.set[0];
    }

    function drawVehicle(context, to, colours) {
      if (axis.cursor === null) return;
      const i = viewer.nearest(track.time, axis.cursor);
      if (i < 0 || Number.isNaN(track.north[i])) return;
      context.save();
      context.translate(to.x(track.east[i]), to.y(track.north[i]));
      context.rotate(Number.isNaN(track.heading[i]) ? 0 : track.heading[i]);
      context.beginPath();
      [[0, -11], [7.5, 8], [0, 4], [-7.5, 8]].forEach(([x, y]) => context.lineTo(x, y));
      context.closePath();
      context.fillStyle = colours.bad;
      context.strokeStyle = colours.ground;
      context.lineWidth = 1.5;
      context.fill();
      context.stroke();
      context.restore();
    }

    function tellLegend() {
      const parts = [];
      if (by === "height") {
        const stops = h("span", { class: "fv-scale" }, view.colours.height.map((_, k) => h("i", { class: `fv-height-${k}` })));
        const { withUnit } = viewer.words;
        parts.push(h("span", {}, withUnit(track.lowest, "m"), " ", stops, " ", withUnit(track.highest, "m"), " high"));
      }
      if (by === "manoeuvre") {
        kinds.forEach((kind, k) => parts.push(h("span", {}, h("i", { class: `fv-key fv-manoeuvre-${k % view.colours.manoeuvre.length}` }), kind)));
      }
      if (track.mission.length) parts.push(h("span", {}, h("i", { class: "fv-key is-dashed" }), "mission"));
      if (track.gnss) parts.push(h("span", {}, h("i", { class: "fv-key is-dot" }), "GNSS fixes"));
      legend.replaceChildren(...parts);
      plot.setAttribute("aria-label", described(track));
    }

    addMapGestures(plot, sight, () => projection(canvas.width(), canvas.height), zoomBy, () => canvas.redraw());
    plot.addEventListener("pointermove", (event) => {
      if (event.pointerType === "mouse" && event.buttons) return;
      const box = canvas.element.getBoundingClientRect();
      const i = nearestOnTrack(track, projection(canvas.width(), canvas.height), event.clientX - box.left, event.clientY - box.top, axis);
      if (i >= 0) axis.setCursor(track.time[i]);
      else if (event.pointerType === "mouse") axis.setCursor(null);
    });
    plot.addEventListener("mouseleave", () => axis.setCursor(null));
    tellLegend();

    return {
      element,
      draw(width) {
        canvas.height = Math.round(Math.min(Math.max(0.85 * width, 220), 380));
        canvas.resize(width);
      },
      colourBy(to) {
        by = choices.includes(to) ? to : choices[0];
        colouring.value = by;
        tellLegend();
        canvas.redraw();
      },
      refresh: () => canvas.redraw(),
    };
  };

  function readTrack(model) {
    if (!model.track) return null;
    const read = (from, prefix = "") => Object.fromEntries(
      ["time", "north", "east", "height", "heading"].map((name) => [name, model.array(from[prefix + name])]),
    );
    const track = { ...read(model.track), manoeuvres: model.track.manoeuvres || [], mission: model.track.mission || [] };
    track.gnss = model.track.gnss_time === undefined || model.track.gnss_time === null ? null : read(model.track, "gnss_");
    track.sets = Object.entries(model.track.sets || {}).map(([name, own]) => [name, read(own)]);
    track.heading = track.heading || new Float32Array(track.time.length).fill(NaN);
    const all = [track, ...(track.gnss ? [track.gnss] : [])];
    const bounds = (name, more) => viewer.extremes([...all.flatMap((one) => viewer.extremes(one[name])), ...more]);
    const [south, north] = bounds("north", track.mission.map((place) => place[0]));
    const [west, east] = bounds("east", track.mission.map((place) => place[1]));
    if (!(north >= south)) return null;
    track.box = {
      north: (north + south) / 2, east: (east + west) / 2,
      high: Math.max(north - south, LEAST_M), wide: Math.max(east - west, LEAST_M),
    };
    [track.lowest, track.highest] = viewer.extremes(track.height);
    track.kindAt = kindsAt(track);
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
    const i = track.north.findIndex((value) => !Number.isNaN(value));
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
    [[0, -14], [5, 2], [0, -2], [-5, 2]].forEach(([x, y]) => context.lineTo(x, y));
    context.fill();
    context.textAlign = "center";
    context.textBaseline = "top";
    context.font = "12px system-ui, sans-serif";
    context.fillText("N", 0, 4);
    context.restore();
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

  /* Drag moves the map, Ctrl and wheel or two fingers zoom it; one finger scrolls the page. */
  function addMapGestures(plot, sight, projection, zoomBy, redraw) {
    let drag = null;
    const fingers = new Map();
    const apart = () => {
      const [a, b] = [...fingers.values()];
      return Math.max(Math.hypot(a.x - b.x, a.y - b.y), 20);
    };
    plot.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      zoomBy(Math.exp(-event.deltaY * 0.003));
    }, { passive: false });
    plot.addEventListener("dblclick", () => zoomBy(1e-6));
    plot.addEventListener("pointerdown", (event) => {
      if (event.pointerType !== "mouse") {
        fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
        return;
      }
      drag = { x: event.clientX, y: event.clientY, east: sight.east, north: sight.north };
      plot.setPointerCapture(event.pointerId);
    });
    plot.addEventListener("pointermove", (event) => {
      if (fingers.has(event.pointerId) && fingers.size === 2) {
        const before = apart();
        fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
        zoomBy(apart() / before);
      }
      if (!drag || sight.zoom === 1) return;
      const { scale } = projection();
      sight.east = drag.east - (event.clientX - drag.x) / scale;
      sight.north = drag.north + (event.clientY - drag.y) / scale;
      redraw();
    });
    for (const end of ["pointerup", "pointercancel", "pointerleave"]) {
      plot.addEventListener(end, (event) => {
        fingers.delete(event.pointerId);
        drag = null;
      });
    }
  }

  function described(track) {
    const { figure } = viewer.words;
    return `Track from above: ${figure(track.box.high)} m from south to north, ${figure(track.box.wide)} m from west to east, `
      + `between ${figure(track.lowest)} and ${figure(track.highest)} m high.`;
  }
})();
