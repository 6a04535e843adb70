/* A panel: curves of the chosen sets over the common time axis, with what they are at the cursor. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const HEIGHT = 170;
  const MOST_BOUNDED = 2;
  const NEAR_PX = 14;
  const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif";
  const LOG_SPAN = 1e5;
  const INCREMENTS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600];

  viewer.makePanel = (view, panel) => {
    const { model, axis } = view;
    const { h } = viewer;
    const all = panel.series.map((given, place) => seriesOf(view, given, place, panel.kind));
    const plot = h("div", { class: "fv-plot", role: "img" });
    const legend = h("ul", { class: "fv-legend" });
    const figures = h("div", { class: "fv-figures" });
    const shut = viewer.discloser("Figures", figures, {
      className: "fv-figures-button",
      changed: (open) => open && fillFigures(),
    });
    shut.button.setAttribute("aria-label", `Figures of ${panel.title}`);
    const element = h(
      "section",
      { class: "fv-panel", "data-panel": panel.id, "aria-label": panel.title },
      h(
        "div",
        { class: "fv-panel-head" },
        h(
          "h4",
          {},
          viewer.words.heading(panel.title),
          panel.unit ? h("span", { class: "fv-unit" }, ` ${panel.unit}`) : null,
        ),
        shut.button,
      ),
      legend,
      plot,
      figures,
    );
    let u = null;
    let width = 0;
    let values = [];
    let places = [];
    let isLog = Boolean(panel.log);

    const shown = () => all.filter((series) => view.isShown(series.set));
    const bounded = () =>
      shown()
        .filter((series) => series.sigma)
        .slice(0, MOST_BOUNDED);

    function make() {
      const joined = viewer.joined(all, { log: isLog });
      places = joined.places;
      u = new uPlot(options(), joined.columns, plot);
      u.over.addEventListener("mouseleave", () => axis.setCursor(null));
      viewer.addGestures(u.over, axis, timeAt, () => u.over.clientWidth);
    }

    const timeAt = (clientX) => u.posToVal(clientX - u.over.getBoundingClientRect().left, "x");

    function options() {
      const stroke = (k) => () => view.colours.set[all[k].style % viewer.STYLES];
      const grid = { stroke: () => view.colours.line, width: 1 };
      const ink = () => view.colours.quiet;
      return {
        width,
        height: HEIGHT,
        padding: [8, viewer.GUTTER.right, 0, 0],
        legend: { show: false },
        cursor: {
          y: false,
          dataIdx: atCursor,
          bind: { dblclick: () => null },
          drag: { x: true, y: false, setScale: false, dist: 5 },
          points: { size: 8, width: 1.5, stroke: () => view.colours.ground, fill: (_, k) => stroke(k - 1)() },
        },
        scales: {
          x: { time: false, range: () => [axis.from, axis.to] },
          y: { distr: isLog ? 3 : 1, range: rangeOf },
        },
        axes: [
          {
            stroke: ink,
            grid,
            ticks: { ...grid, size: 4 },
            font: FONT,
            size: 26,
            gap: 3,
            space: 64,
            incrs: INCREMENTS,
            splits: splitsFrom(model.origin),
            values: (_, at) => at.map((t) => timeTick(t - model.origin, model)),
          },
          {
            stroke: ink,
            grid,
            ticks: { ...grid, size: 4 },
            font: FONT,
            size: viewer.GUTTER.left,
            gap: 4,
            space: 28,
            splits: isLog ? decades : undefined,
            values: (_, at) => at.map((value) => (value === null ? "" : viewer.words.tick(value))),
          },
        ],
        series: [
          {},
          ...all.map((series, k) => ({
            label: series.label,
            show: view.isShown(series.set),
            stroke: stroke(k),
            width: series.leads ? 1.75 : 1.25,
            paths:
              series.draw === "step"
                ? uPlot.paths.stepped({ align: 1 })
                : series.draw === "points"
                  ? () => null
                  : undefined,
            points: series.draw === "points" ? { show: true, size: 4, width: 0, fill: stroke(k) } : { show: false },
          })),
        ],
        hooks: {
          drawAxes: [(plotted) => viewer.drawUnder(plotted, view, panel, bounded())],
          draw: [(plotted) => viewer.drawOver(plotted, view, shown(), shown().filter((one) => one.set).length > 1)],
          setSelect: [
            (plotted) => {
              const { left, width: wide } = plotted.select;
              if (wide < 3) return;
              const [t0, t1] = [plotted.posToVal(left, "x"), plotted.posToVal(left + wide, "x")];
              plotted.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
              axis.setWindow(t0, t1);
            },
          ],
          setCursor: [
            (plotted) => {
              if (plotted.cursor.event && plotted.cursor.left >= 0)
                axis.setCursor(plotted.posToVal(plotted.cursor.left, "x"));
            },
          ],
        },
      };
    }

    /* The sample of a series that is meant at a moment; -1 where there is none near. */
    function sampleAt(series, t) {
      const i = viewer.nearest(series.times, t);
      if (i < 0) return -1;
      const pixel = (axis.to - axis.from) / Math.max(width - viewer.GUTTER.left - viewer.GUTTER.right, 1);
      const away = Math.abs(series.times[i] - t);
      return away <= Math.max(NEAR_PX * pixel, series.spacing) && !Number.isNaN(series.values[i]) ? i : -1;
    }

    function atCursor(_, k, index, t) {
      if (!k) return index;
      const i = sampleAt(all[k - 1], t);
      return i < 0 ? null : places[k - 1][i];
    }

    function rangeOf() {
      const [from, to] = model.counts(axis.from, axis.to);
      const [least, most] = viewer.extremes(shown().flatMap((series) => seenOf(series, from, to, isLog)));
      if (least > most) return isLog ? [0.01, 1] : [-1, 1];
      if (isLog) {
        const top = Math.max(most, panel.limit || 0) * 1.3;
        return [Math.max(Math.min(least, top / 100), top / LOG_SPAN), top];
      }
      let [low, high] = [least, most];
      for (const series of bounded()) {
        const [lowest, highest] = boundsOf(series, from, to, view.showsGate() ? series.gate || 1 : 1);
        const far = Math.max(-lowest, highest) > 3 * Math.max(Math.abs(least), Math.abs(most));
        if (panel.kind === "innovation" && far && !view.showsGate()) continue;
        [low, high] = [Math.min(low, lowest), Math.max(high, highest)];
      }
      if (panel.kind === "ratio") low = Math.min(low, 0);
      const limit = panel.limit ?? null;
      if (limit !== null && limit < 3 * high) high = Math.max(high, limit);
      const pad = 0.06 * (high - low) || 0.06 * Math.abs(high) || 1;
      return [low - (panel.kind === "ratio" && low === 0 ? 0 : pad), high + pad];
    }

    function fillLegend() {
      values = shown().map((series) => ({ series, value: h("span", { class: "fv-value" }) }));
      legend.replaceChildren(
        ...values.map(({ series, value }) =>
          h(
            "li",
            {},
            viewer.swatch(series.style, series.draw === "points" || !series.set ? null : series.marker),
            h("span", { class: "fv-name" }, series.label),
            value,
          ),
        ),
      );
    }

    function tellValues() {
      for (const { series, value } of values) {
        const i = axis.cursor === null ? -1 : sampleAt(series, axis.cursor);
        value.textContent = i < 0 ? "" : told(series, i);
        value.classList.toggle("is-rejected", i >= 0 && Boolean(series.rejected && series.rejected[i]));
      }
    }

    function told(series, i) {
      const { withUnit } = viewer.words;
      const sigmas = series.sigma && series.sigma[i] > 0 ? toldSigma(series, i) : "";
      const out = series.rejected && series.rejected[i] ? " rejected" : "";
      return withUnit(series.values[i], panel.unit) + sigmas + out;
    }

    /* Of an innovation in how many standard deviations it lies, of an estimate how well it is known. */
    function toldSigma({ values: all, sigma }, i) {
      if (panel.kind !== "innovation") return ` ± ${viewer.words.figure(sigma[i])}`;
      return ` (${(all[i] / sigma[i]).toFixed(1).replace("-0.0", "0.0").replace("-", "−")} σ)`;
    }

    function describe() {
      const parts = shown().map((series) => {
        const found = viewer.summary(series);
        const text = `${series.label}: from ${viewer.words.figure(found.least)} to ${viewer.words.withUnit(found.most, panel.unit)}`;
        const lost = viewer.rejectedOf(series, found);
        return lost ? `${text}, ${lost}` : text;
      });
      plot.setAttribute("aria-label", `${panel.title} over time. ${parts.join("; ")}.`);
    }

    function fillFigures() {
      const { figure } = viewer.words;
      const at = (t) => (Number.isNaN(t) ? "–" : model.moment(t));
      const rows = shown().map((series) => {
        const seen = viewer.summary(series, axis.from, axis.to);
        const entire = viewer.summary(series);
        return [
          series.label,
          figure(seen.least),
          at(seen.leastAt),
          figure(seen.most),
          at(seen.mostAt),
          viewer.rejectedOf(series, entire) || "–",
        ];
      });
      const unit = panel.unit ? `, ${panel.unit}` : "";
      figures.replaceChildren(
        viewer.table(
          ["", "smallest", "when", "largest", "when", "rejected, whole flight"],
          rows,
          `${panel.title}${unit}: ${axis.isWhole() ? "the whole flight" : "what is in view"}`,
        ),
      );
    }

    fillLegend();
    describe();

    return {
      element,
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
        if (what === "cursor") tellValues();
        if (what === "sets") {
          fillLegend();
          describe();
          tellValues();
          if (u) all.forEach((series, k) => u.setSeries(k + 1, { show: view.isShown(series.set) }, false));
        }
        if (!figures.hidden && what !== "cursor") fillFigures();
        if (!u) return;
        if (what === "cursor") moveCursor();
        else if (what === "theme") u.redraw(false);
        else u.setScale("x", { min: axis.from, max: axis.to });
      },
      destroy() {
        if (u) u.destroy();
        u = null;
      },
    };

    function moveCursor() {
      if (u.cursor.event && u.cursor.left >= 0 && u.over.matches(":hover")) return;
      const inView = axis.cursor !== null && axis.cursor >= axis.from && axis.cursor <= axis.to;
      u.setCursor(inView ? { left: u.valToPos(axis.cursor, "x"), top: 1 } : { left: -10, top: -10 }, false);
    }
  };

  function seriesOf(view, given, place, kind) {
    const set = given.set ? view.model.sets.get(given.set) : null;
    const data = view.model.data(given);
    return {
      ...given,
      ...data,
      place,
      middle: kind === "innovation" ? null : data.values, // of ±1σ: zero for innovations, else the estimate itself
      style: set ? set.style : (given.style ?? 0),
      marker: set ? set.marker : null,
      leads: Boolean(set && (set.role === "present" || set.role === "chosen")),
      spacing:
        data.times.length > 1
          ? (1.5 * (data.times[data.times.length - 1] - data.times[0])) / (data.times.length - 1)
          : 0,
    };
  }

  /* Smallest and largest value between two times, neighbours included; on a logarithmic axis of those above zero. */
  function seenOf({ times, values }, from, to, log) {
    const [first, last] = viewer.within(times, from, to);
    const seen = values.subarray(first, last + 1);
    return viewer.extremes(log ? seen.filter((value) => value > 0) : seen).filter(Number.isFinite);
  }

  /* How far so many standard deviations reach down and up between two times; nowhere where none is known. */
  function boundsOf({ times, sigma, middle }, from, to, factor) {
    const [first, last] = viewer.within(times, from, to);
    let [least, most] = [Infinity, -Infinity];
    for (let i = first; i <= last; i += 1) {
      const at = middle ? middle[i] : 0;
      if (at - factor * sigma[i] < least) least = at - factor * sigma[i];
      if (at + factor * sigma[i] > most) most = at + factor * sigma[i];
    }
    return [least, most];
  }

  /* Round figures since take-off, not since the log began. */
  function splitsFrom(origin) {
    return (_, __, least, most, step) => {
      const found = [];
      for (let k = Math.ceil((least - origin) / step - 1e-6); origin + k * step <= most + 1e-9; k += 1)
        found.push(origin + k * step);
      return found;
    };
  }

  /* Powers of ten; 2 and 5 between them where there is room. */
  function decades(_, __, least, most) {
    const factors = Math.log10(most / least) > 2 ? [1] : [1, 2, 5];
    const found = [];
    for (let power = Math.floor(Math.log10(least)); power <= Math.ceil(Math.log10(most)); power += 1) {
      found.push(...factors.map((factor) => factor * 10 ** power).filter((value) => value >= least && value <= most));
    }
    return found;
  }

  function timeTick(since, model) {
    const { tick, MINUTES_FROM_S } = viewer.words;
    const rounded = Math.round(since * 1e4) / 1e4;
    if (model.stop < MINUTES_FROM_S) return `${tick(rounded)} s`;
    const whole = Math.abs(rounded);
    const minutes = Math.floor(whole / 60);
    const rest = Math.round((whole - 60 * minutes) * 100) / 100;
    return `${rounded < 0 ? "−" : ""}${minutes}:${rest < 10 ? "0" : ""}${rest}`;
  }

  /* Share of all samples where the data count them, else how many are marked; nothing of what no gate judges. */
  viewer.rejectedOf = ({ rejected, samples, rejected_samples: lost }, found) => {
    if (lost === 0) return "none rejected";
    if (lost) return `${viewer.words.share(lost, samples)} rejected`;
    return rejected ? `${found.rejected} marked as rejected` : "";
  };
})();
