/* The whole flight in one strip: height, flight modes, findings and events, and what of it is in view. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const EVENTS = 9;
  const MODES = 16;
  const PROFILE = 26;
  const FINDINGS = 11;
  const NEAR_PX = 7;

  viewer.makeStrip = (view) => {
    const { model, axis } = view;
    const { h, visible, fitted } = viewer;
    const modes = model.bands.find((band) => band.id === "nav_state");
    const rows = lay(modes, model);
    const longFirst = [...model.marks].sort((a, b) => b.t1 - b.t0 - (a.t1 - a.t0)); // so that short ones stay visible
    const canvas = viewer.makeCanvas(rows.height, draw);
    const element = h(
      "div",
      {
        class: "fv-strip",
        role: "slider",
        tabindex: "0",
        "aria-label": "moment of the flight",
        "aria-valuemin": String(Math.floor(model.start)),
        "aria-valuemax": String(Math.ceil(model.stop)),
        "aria-valuenow": String(Math.round(model.start)),
        title: "Drag to choose what is in view; drag within it to move it",
      },
      canvas.element,
    );
    const whole = () => viewer.scaleOf(model.start, model.stop, canvas.width());
    const at = (clientX) => whole().t(clientX - canvas.element.getBoundingClientRect().left);

    function draw(context, width, height) {
      const { colours } = view;
      const scale = whole();
      drawProfile(context, scale, model, rows, colours);
      if (modes) drawModes(context, scale, modes.spans, rows.modes, colours);
      for (const mark of longFirst) {
        const place = visible(scale, mark.t0, mark.t1, 3);
        if (!place) continue;
        context.fillStyle = colours.severity[mark.severity] || colours.quiet;
        context.fillRect(place[0], rows.findings + 3, place[1] - place[0], 5);
      }
      context.fillStyle = colours.quiet;
      for (const event of model.events) {
        const x = scale.x(event.t);
        context.beginPath();
        context.moveTo(x - 3.5, 1);
        context.lineTo(x + 3.5, 1);
        context.lineTo(x, 7.5);
        context.fill();
      }
      drawNames(context, rows, colours, modes, model);
      const [x0, x1] = [scale.x(axis.from), scale.x(axis.to)];
      context.fillStyle = colours.ground;
      context.globalAlpha = 0.66;
      context.fillRect(scale.left, 0, x0 - scale.left, height);
      context.fillRect(x1, 0, scale.right - x1, height);
      context.globalAlpha = 1;
      if (!axis.isWhole()) {
        context.strokeStyle = colours.accent;
        context.lineWidth = 1.5;
        context.strokeRect(x0, 0.75, Math.max(x1 - x0, 2), height - 1.5);
      }
      viewer.cursorLine(context, scale, axis.cursor, height, colours.bad);
    }

    function drawModes(context, scale, spans, top, colours) {
      spans.forEach(([t0, t1, name], i) => {
        const place = visible(scale, t0, t1);
        if (!place) return;
        const [x0, x1] = place;
        context.fillStyle = i % 2 ? colours.line : colours["line-strong"];
        context.globalAlpha = 0.6;
        context.fillRect(x0, top, Math.max(x1 - x0 - 1, 1), MODES - 3);
        context.globalAlpha = 1;
        context.fillStyle = colours.ink;
        context.textBaseline = "middle";
        context.textAlign = "left";
        context.font = "11px system-ui, sans-serif";
        context.fillText(fitted(context, name, x1 - x0 - 8), x0 + 4, top + (MODES - 3) / 2 + 0.5);
      });
    }

    const dragged = addDragging(element, axis, at);
    /* Clicked, a finding is shown. */
    element.addEventListener("click", (event) => {
      if (dragged()) return;
      const y = event.clientY - canvas.element.getBoundingClientRect().top;
      if (y < rows.findings || y > rows.findings + FINDINGS || !model.marks.length) return;
      const near = (NEAR_PX / (whole().right - whole().left)) * (model.stop - model.start);
      const hit = model.marks.filter(
        (mark) => at(event.clientX) >= mark.t0 - near && at(event.clientX) <= mark.t1 + near,
      );
      hit.sort((a, b) => a.t1 - a.t0 - (b.t1 - b.t0));
      if (hit.length) axis.jump(hit[0].t0, hit[0].t1);
    });
    viewer.addGestures(element, axis, at, () => whole().right - whole().left, { cursor: false });

    function tell() {
      const t = axis.cursor ?? axis.from;
      element.setAttribute("aria-valuenow", String(Math.round(t)));
      element.setAttribute("aria-valuetext", view.telling(t));
    }
    tell();
    return {
      element,
      resize: (width) => canvas.resize(width),
      redraw() {
        canvas.redraw();
        tell();
      },
    };
  };

  function lay(modes, model) {
    const rows = {};
    let top = model.events.length ? EVENTS : 0;
    rows.modes = top;
    top += modes ? MODES : 0;
    rows.profile = top;
    top += model.track ? PROFILE : 6;
    rows.findings = top;
    top += model.marks.length ? FINDINGS : 0;
    rows.height = Math.max(top, 24);
    return rows;
  }

  function drawProfile(context, scale, model, rows, colours) {
    if (!model.track) return;
    const times = model.array(model.track.time);
    const heights = model.array(model.track.height);
    const [least, most] = viewer.extremes(heights);
    if (!(most > least)) return;
    const bottom = rows.profile + PROFILE - 1;
    context.beginPath();
    context.moveTo(scale.x(times[0]), bottom);
    let last = times[0];
    for (let i = 0; i < times.length; i += 1) {
      if (Number.isNaN(heights[i])) continue;
      context.lineTo(scale.x(times[i]), bottom - 1 - ((heights[i] - least) / (most - least)) * (PROFILE - 5));
      last = times[i];
    }
    context.lineTo(scale.x(last), bottom);
    context.fillStyle = colours.accent;
    context.globalAlpha = 0.22;
    context.fill();
    context.globalAlpha = 1;
  }

  function drawNames(context, rows, colours, modes, model) {
    context.fillStyle = colours.quiet;
    context.textAlign = "right";
    context.textBaseline = "middle";
    context.font = "11px system-ui, sans-serif";
    const right = viewer.GUTTER.left - 6;
    if (modes) context.fillText("mode", right, rows.modes + MODES / 2 - 1);
    if (model.track) context.fillText("height", right, rows.profile + PROFILE / 2);
    if (model.marks.length) context.fillText("findings", right, rows.findings + FINDINGS / 2);
  }

  /* A drag chooses a window; one that begins within the window moves it. Answers whether the last press was one. */
  function addDragging(element, axis, at) {
    let drag = null;
    let far = false;
    element.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || !event.isPrimary) return;
      const t = at(event.clientX);
      far = false;
      drag = { t, from: axis.from, x: event.clientX, moves: !axis.isWhole() && t > axis.from && t < axis.to };
      element.setPointerCapture(event.pointerId);
    });
    element.addEventListener("pointermove", (event) => {
      const t = at(event.clientX);
      if (!drag) {
        if (event.pointerType === "mouse") axis.setCursor(t);
        return;
      }
      if (Math.abs(event.clientX - drag.x) < 4 && !far) return;
      far = true;
      if (drag.moves) axis.setWindow(drag.from + t - drag.t, drag.from + t - drag.t + axis.to - axis.from);
      else axis.setWindow(Math.min(t, drag.t), Math.max(t, drag.t));
    });
    element.addEventListener("pointerup", (event) => {
      if (drag && !far) axis.setCursor(at(event.clientX));
      drag = null;
    });
    element.addEventListener("pointercancel", () => (drag = null));
    return () => far;
  }
})();
