/* Flight modes and flags: when each was so, one row under the other, over the common time axis. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const ROW = 34;
  const BAR = 13;
  const NAME = 16;
  const TOP = 2;

  viewer.makeBands = (view, bands) => {
    const { model, axis } = view;
    const { h, visible, fitted } = viewer;
    const canvas = viewer.makeCanvas(TOP + ROW * bands.length, draw);
    const now = h("p", { class: "fv-now" });
    const plot = h(
      "div",
      { class: "fv-plot fv-bands", role: "img", "aria-label": described(view, bands) },
      canvas.element,
    );
    const figures = h("div", { class: "fv-figures" });
    const shut = viewer.discloser("Times", figures, {
      className: "fv-figures-button",
      changed: (open) => open && figures.replaceChildren(timesTable(view, bands)),
    });
    shut.button.setAttribute("aria-label", "Times of flight modes and flags");
    const element = h(
      "section",
      { class: "fv-panel", "data-panel": "bands", "aria-label": "Flight modes and flags" },
      h("div", { class: "fv-panel-head" }, h("h4", {}, "Flight modes and flags"), shut.button),
      now,
      plot,
      figures,
    );
    const scale = () => viewer.scaleOf(axis.from, axis.to, canvas.width());
    const at = (clientX) => scale().t(clientX - canvas.element.getBoundingClientRect().left);
    const widthOf = () => scale().right - scale().left;

    function draw(context, width, height) {
      const { colours } = view;
      const place = scale();
      bands.forEach((band, row) => {
        const top = TOP + row * ROW;
        context.fillStyle = colours.ink;
        context.textAlign = "left";
        context.textBaseline = "middle";
        context.font = "12px system-ui, sans-serif";
        context.fillText(fitted(context, band.label, width - 10), 4, top + NAME / 2 + 1);
        context.fillStyle = colours.sunk;
        context.fillRect(place.left, top + NAME, place.right - place.left, BAR);
        band.spans.forEach(([t0, t1, text], i) => {
          const x = visible(place, t0, t1);
          if (!x) return;
          context.fillStyle = text ? colours.set[[1, 3][i % 2]] : colours.accent;
          context.globalAlpha = 0.8;
          context.fillRect(x[0], top + NAME, x[1] - x[0], BAR);
          context.globalAlpha = 1;
          if (!text) return;
          context.fillStyle = colours.ground;
          context.font = "11px system-ui, sans-serif";
          context.fillText(fitted(context, text, x[1] - x[0] - 8), x[0] + 4, top + NAME + BAR / 2 + 0.5);
        });
      });
      viewer.cursorLine(context, place, axis.cursor, height, colours.bad);
    }

    plot.addEventListener("pointermove", (event) => event.pointerType === "mouse" && axis.setCursor(at(event.clientX)));
    plot.addEventListener("mouseleave", () => axis.setCursor(null));
    viewer.addGestures(plot, axis, at, widthOf);
    viewer.addSelection(plot, axis, at);

    return {
      element,
      isDrawn: () => canvas.width() > 0,
      draw(width) {
        if (width !== canvas.width()) canvas.resize(width);
      },
      refresh(what) {
        if (what === "cursor") now.textContent = axis.cursor === null ? "" : toldAt(bands, axis.cursor);
        canvas.redraw();
      },
      destroy() {},
    };
  };

  function toldAt(bands, t) {
    const found = [];
    for (const band of bands) {
      const span = band.spans.find(([t0, t1]) => t >= t0 && t < t1);
      if (span) found.push(span[2] ? `${band.label}: ${span[2]}` : band.label);
    }
    return found.join(" · ") || "nothing of this";
  }

  function described(view, bands) {
    const { model } = view;
    return bands
      .map((band) => {
        const lasts = band.spans.reduce((sum, [t0, t1]) => sum + t1 - t0, 0);
        const names = [...new Set(band.spans.map((span) => span[2]).filter(Boolean))];
        const told = names.length ? `${band.label} (${names.join(", ")})` : band.label;
        return `${told}: ${viewer.words.share(lasts, model.stop - model.start)} of the log`;
      })
      .join("; ");
  }

  function timesTable(view, bands) {
    const rows = bands.flatMap((band) =>
      band.spans.map(([t0, t1, text]) => [
        text ? `${band.label}: ${text}` : band.label,
        view.model.moment(t0),
        viewer.words.seconds(t1 - t0, 1),
      ]),
    );
    return viewer.table(["", "since", "for"], rows, "Flight modes and flags: the whole flight");
  }

  /* A drag of the mouse chooses a window, as in the panels. */
  viewer.addSelection = (element, axis, at) => {
    const box = viewer.h("div", { class: "fv-selection", hidden: true });
    element.append(box);
    let begun = null;
    const place = (event) => event.clientX - element.getBoundingClientRect().left;
    element.addEventListener("pointerdown", (event) => {
      if (event.pointerType !== "mouse" || event.button !== 0) return;
      begun = { t: at(event.clientX), x: place(event) };
      element.setPointerCapture(event.pointerId);
    });
    element.addEventListener("pointermove", (event) => {
      if (!begun) return;
      const x = place(event);
      box.hidden = Math.abs(x - begun.x) < 5;
      box.style.left = `${Math.min(x, begun.x)}px`;
      box.style.width = `${Math.abs(x - begun.x)}px`;
    });
    element.addEventListener("pointerup", (event) => {
      if (begun && !box.hidden) {
        const t = at(event.clientX);
        axis.setWindow(Math.min(t, begun.t), Math.max(t, begun.t));
      }
      begun = null;
      box.hidden = true;
    });
  };
})();
