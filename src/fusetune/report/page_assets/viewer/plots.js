/* A panel: curves of the chosen sets over the common time axis, with what they are at the cursor. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const HEIGHT = 170;
  const MOST_BOUNDED = 2;

  viewer.makePanel = (view, panel) => {
    const { axis } = view;
    const all = panel.series.map((given, place) => viewer.seriesOf(view, given, place, panel.kind));
    const shown = () => all.filter((series) => view.isShown(series.set));
    const bounded = () =>
      shown()
        .filter((series) => series.sigma)
        .slice(0, MOST_BOUNDED);
    const parts = frameOf(panel, () => viewer.figuresOf(view, panel, shown()));
    let u = null;
    let width = 0;
    let values = [];
    let places = [];
    let isLog = Boolean(panel.log);
    const sampleAt = (series, t) =>
      viewer.sampleAt(series, t, (axis.to - axis.from) / Math.max(u ? u.over.clientWidth : 1, 1));

    function make() {
      const joined = viewer.joined(all, { log: isLog });
      places = joined.places;
      u = new uPlot(
        {
          width,
          height: HEIGHT,
          padding: [8, viewer.GUTTER.right, 0, 0],
          legend: { show: false },
          cursor: cursorOf(view, all, atCursor),
          scales: {
            x: { time: false, range: () => [axis.from, axis.to] },
            y: { distr: isLog ? 3 : 1, range: () => viewer.rangeOf(view, panel, shown(), bounded(), isLog) },
          },
          axes: viewer.axesOf(view, isLog),
          series: [{}, ...all.map((series) => curveOf(view, series))],
          hooks: {
            drawAxes: [(plotted) => viewer.drawUnder(plotted, view, panel, bounded())],
            draw: [(plotted) => viewer.drawOver(plotted, view, shown(), shown().filter((one) => one.set).length > 1)],
            setSelect: [(plotted) => showSelected(plotted, axis)],
            setCursor: [
              ({ cursor, posToVal }) => cursor.event && cursor.left >= 0 && axis.setCursor(posToVal(cursor.left, "x")),
            ],
          },
        },
        joined.columns,
        parts.plot,
      );
      const timeAt = (clientX) => u.posToVal(clientX - u.over.getBoundingClientRect().left, "x");
      u.over.addEventListener("mouseleave", () => axis.setCursor(null));
      viewer.addGestures(u.over, axis, timeAt, () => u.over.clientWidth);
    }

    function atCursor(k, t) {
      const i = sampleAt(all[k], t);
      return i < 0 ? null : places[k][i];
    }

    function tellSets() {
      values = shown().map((series) => ({ series, value: viewer.h("span", { class: "fv-value" }) }));
      parts.legend.replaceChildren(...values.map(({ series, value }) => legendOf(series, value)));
      parts.plot.setAttribute("aria-label", viewer.describedPanel(panel, shown()));
    }

    function tellValues() {
      for (const { series, value } of values) {
        const i = axis.cursor === null ? -1 : sampleAt(series, axis.cursor);
        value.textContent = i < 0 ? "" : viewer.toldSample(series, i, panel);
        value.classList.toggle("is-rejected", i >= 0 && Boolean(series.rejected && series.rejected[i]));
      }
    }

    function moveCursor() {
      if (u.cursor.event && u.cursor.left >= 0 && u.over.matches(":hover")) return;
      const inView = axis.cursor !== null && axis.cursor >= axis.from && axis.cursor <= axis.to;
      u.setCursor(inView ? { left: u.valToPos(axis.cursor, "x"), top: 1 } : { left: -10, top: -10 }, false);
    }

    tellSets();
    return {
      element: parts.element,
      panel,
      isLog: () => isLog,
      setLog(to) {
        isLog = to;
        if (!u) return;
        u.destroy();
        make();
      },
      isDrawn: () => u !== null,
      draw(to) {
        width = to;
        if (!u) make();
        else if (u.width !== width) u.setSize({ width, height: HEIGHT });
      },
      refresh(what) {
        if (what === "sets") tellSets();
        if (what === "sets" || what === "cursor") tellValues();
        if (what !== "cursor") parts.refreshFigures();
        if (!u) return;
        if (what === "sets") all.forEach((series, k) => u.setSeries(k + 1, { show: view.isShown(series.set) }, false));
        if (what === "cursor") moveCursor();
        else if (what === "theme") u.redraw(false);
        else u.setScale("x", { min: axis.from, max: axis.to });
      },
      destroy() {
        if (u) u.destroy();
        u = null;
      },
    };
  };

  /* The elements of a panel; its figures are made when they are asked for. */
  function frameOf(panel, makeFigures) {
    const { h, words } = viewer;
    const figures = h("div", { class: "fv-figures" });
    const refreshFigures = () => !figures.hidden && figures.replaceChildren(makeFigures());
    const { button } = viewer.discloser("Figures", figures, {
      className: "fv-figures-button",
      changed: refreshFigures,
    });
    button.setAttribute("aria-label", `Figures of ${panel.title}`);
    const unit = panel.unit ? h("span", { class: "fv-unit" }, ` ${panel.unit}`) : null;
    const head = h("div", { class: "fv-panel-head" }, h("h4", {}, words.heading(panel.title), unit), button);
    const legend = h("ul", { class: "fv-legend" });
    const plot = h("div", { class: "fv-plot", role: "img" });
    const attributes = { class: "fv-panel", "data-panel": panel.id, "aria-label": panel.title };
    return { element: h("section", attributes, head, legend, plot, figures), legend, plot, refreshFigures };
  }

  function legendOf(series, value) {
    const { h, swatch } = viewer;
    const marker = series.draw === "points" || !series.set ? null : series.marker;
    return h("li", {}, swatch(series.style, marker), h("span", { class: "fv-name" }, series.label), value);
  }

  const colourOf = (view, series) => view.colours.set[series.style % viewer.STYLES];

  function cursorOf(view, all, atCursor) {
    return {
      y: false,
      dataIdx: (_, k, index, t) => (k ? atCursor(k - 1, t) : index),
      bind: { dblclick: () => null },
      drag: { x: true, y: false, setScale: false, dist: 5 },
      points: { size: 8, width: 1.5, stroke: () => view.colours.ground, fill: (_, k) => colourOf(view, all[k - 1]) },
    };
  }

  function curveOf(view, series) {
    const stroke = () => colourOf(view, series);
    const isPoints = series.draw === "points";
    const paths = { step: uPlot.paths.stepped({ align: 1 }), points: () => null }[series.draw];
    const points = isPoints ? { show: true, size: 4, width: 0, fill: stroke } : { show: false };
    return {
      label: series.label,
      show: view.isShown(series.set),
      stroke,
      width: series.leads ? 1.75 : 1.25,
      paths,
      points,
    };
  }

  /* What was dragged over is shown; the selection itself goes. */
  function showSelected(plotted, axis) {
    const { left, width } = plotted.select;
    if (width < 3) return;
    const [t0, t1] = [plotted.posToVal(left, "x"), plotted.posToVal(left + width, "x")];
    plotted.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    axis.setWindow(t0, t1);
  }
})();
