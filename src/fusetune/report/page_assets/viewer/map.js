/* The track from above, both axes to one scale: north is up. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const MARGIN_PX = 26;
  const BY = { height: "height", manoeuvre: "manoeuvre", none: "one colour" };

  viewer.makeMap = (view, changed) => {
    const { model, axis } = view;
    const { h, onMap } = viewer;
    const track = viewer.readTrack(model);
    if (!track) return null;
    const sight = { zoom: 1, east: 0, north: 0 };
    const canvas = viewer.makeCanvas(300, draw);
    const kinds = [...new Set(track.manoeuvres.map((span) => span[2]))];
    const choices = Object.keys(BY).filter((by) => by !== "manoeuvre" || kinds.length);
    let by = choices[0];

    const colouring = h(
      "select",
      { id: viewer.uniqueId("map"), onchange: () => changed(colouring.value) },
      choices.map((one) => h("option", { value: one }, BY[one])),
    );
    const legend = h("div", { class: "fv-map-legend" });
    const plot = h("div", { class: "fv-plot fv-map", role: "img" }, canvas.element);
    const zoomBy = (factor) => {
      sight.zoom = Math.min(Math.max(sight.zoom * factor, 1), 200);
      if (sight.zoom === 1) sight.east = sight.north = 0;
      canvas.redraw();
    };
    const button = (label, text, act) =>
      h("button", { type: "button", "aria-label": label, title: label, onclick: act }, text);
    const element = h(
      "section",
      { class: "fv-panel fv-map-panel", "aria-label": "Map" },
      h(
        "div",
        { class: "fv-panel-head" },
        h("h4", {}, "Track from above"),
        h("label", { for: colouring.id, class: "fv-quiet" }, "colour: "),
        colouring,
      ),
      h(
        "span",
        { class: "fv-map-buttons" },
        button("Map closer", "+", () => zoomBy(1.6)),
        button("Map wider", "−", () => zoomBy(1 / 1.6)),
        button("Whole track", "⤢", () => zoomBy(1e-6)),
      ),
      plot,
      legend,
    );

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
      onMap.drawGrid(context, to, width, height, colours);
      onMap.drawMission(context, to, track.mission, colours);
      onMap.drawFixes(context, to, track.gnss, axis, colours);
      for (const [name, own] of track.sets) {
        if (!view.isShown(name)) continue;
        const set = model.sets.get(name);
        context.strokeStyle = colours.set[(set ? set.style : 0) % viewer.STYLES];
        context.lineWidth = 1;
        onMap.line(context, to, own, 0, own.time.length - 1);
      }
      drawTrack(context, to, colours);
      onMap.drawStart(context, to, track, colours);
      drawVehicle(context, to, colours);
      onMap.drawScaleBar(context, to.scale, width, height, colours);
      onMap.drawNorth(context, width, colours);
    }

    function drawTrack(context, to, colours) {
      const [first, last] = viewer.within(track.time, axis.from, axis.to);
      context.lineCap = "round";
      context.strokeStyle = colours["line-strong"];
      context.lineWidth = 1.5;
      if (!axis.isWhole()) onMap.line(context, to, track, 0, track.time.length - 1);
      context.lineWidth = 3;
      let i = first;
      while (i < last) {
        const colour = colourAt(i, colours);
        let end = i + 1;
        while (end < last && colourAt(end, colours) === colour) end += 1;
        context.strokeStyle = colour;
        onMap.line(context, to, track, i, end);
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
        return kind < 0
          ? colours["line-strong"]
          : colours.manoeuvre[kinds.indexOf(track.manoeuvres[kind][2]) % colours.manoeuvre.length];
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
      [
        [0, -11],
        [7.5, 8],
        [0, 4],
        [-7.5, 8],
      ].forEach(([x, y]) => context.lineTo(x, y));
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
        const stops = h(
          "span",
          { class: "fv-scale" },
          view.colours.height.map((_, k) => h("i", { class: `fv-height-${k}` })),
        );
        const { withUnit } = viewer.words;
        parts.push(h("span", {}, withUnit(track.lowest, "m"), " ", stops, " ", withUnit(track.highest, "m"), " high"));
      }
      if (by === "manoeuvre") {
        kinds.forEach((kind, k) =>
          parts.push(
            h("span", {}, h("i", { class: `fv-key fv-manoeuvre-${k % view.colours.manoeuvre.length}` }), kind),
          ),
        );
      }
      if (track.mission.length) parts.push(h("span", {}, h("i", { class: "fv-key is-dashed" }), "mission"));
      if (track.gnss) parts.push(h("span", {}, h("i", { class: "fv-key is-dot" }), "GNSS fixes"));
      legend.replaceChildren(...parts);
      plot.setAttribute("aria-label", viewer.describedTrack(track));
    }

    addMapGestures(
      plot,
      sight,
      () => projection(canvas.width(), canvas.height),
      zoomBy,
      () => canvas.redraw(),
    );
    plot.addEventListener("pointermove", (event) => {
      if (event.pointerType === "mouse" && event.buttons) return;
      const box = canvas.element.getBoundingClientRect();
      const i = viewer.nearestOnTrack(
        track,
        projection(canvas.width(), canvas.height),
        event.clientX - box.left,
        event.clientY - box.top,
        axis,
      );
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

  /* Drag moves the map, Ctrl and wheel or two fingers zoom it; one finger scrolls the page. */
  function addMapGestures(plot, sight, projection, zoomBy, redraw) {
    let drag = null;
    const fingers = new Map();
    const apart = () => {
      const [a, b] = [...fingers.values()];
      return Math.max(Math.hypot(a.x - b.x, a.y - b.y), 20);
    };
    plot.addEventListener(
      "wheel",
      (event) => {
        if (!event.ctrlKey && !event.metaKey) return;
        event.preventDefault();
        zoomBy(Math.exp(-event.deltaY * 0.003));
      },
      { passive: false },
    );
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
})();
