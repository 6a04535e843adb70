/* Puts the viewer where the page has a place for it, and keeps it, the address and the theme together. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const PAPER_PX = 680;
  const MAP_ON_PAPER_PX = 420;

  fusetune.onReady(() => document.querySelectorAll(".flight-viewer").forEach(mount));

  function mount(place) {
    const { h } = viewer;
    const blobs = new Map(
      [...document.querySelectorAll("script.flight-data")].map((data) => [data.dataset.flight, data]),
    );
    const names =
      "choose" in place.dataset ? [...blobs.keys()] : [place.dataset.flight].filter((name) => blobs.has(name));
    const first = names.includes(place.dataset.first) ? place.dataset.first : names[0];
    const status = h("p", { class: "fv-status", role: "status" });
    const body = h("div", { class: "fv-shown" });
    let shown = null;
    let asked = null;
    const textOf = (name) => blobs.get(name).textContent;
    const choice =
      names.length > 1
        ? viewer.makeFlightChoice(names, textOf, (name) =>
            fusetune.state.push({ flight: name === first ? null : name, t: null, source: null, axis: null }),
          )
        : null;
    place.setAttribute("role", "region");
    place.setAttribute("aria-label", "Flight in detail");
    place.replaceChildren(...(choice ? [choice.element] : []), status, body);
    if (!names.length) {
      status.textContent = "Of this flight no curves are kept.";
      return;
    }
    const wanted = () => (names.includes(fusetune.state.get("flight")) ? fusetune.state.get("flight") : first);

    async function show() {
      const name = wanted();
      if (name === asked) return;
      asked = name;
      if (choice) choice.set(name);
      status.textContent = "Unpacking the flight …";
      let data;
      try {
        data = await viewer.decode(textOf(name));
      } catch (error) {
        status.textContent = `The flight cannot be shown. ${error.message}`;
        return;
      }
      if (name !== asked) return;
      if (shown) shown.destroy();
      shown = build(viewer.makeModel(data), body);
      status.textContent = "";
    }

    /* A flight is unpacked when its place is first seen, not while its tab is closed. */
    const seen = new IntersectionObserver(
      (entries) => {
        if (!entries.some((entry) => entry.isIntersecting)) return;
        seen.disconnect();
        show();
        fusetune.state.subscribe((changed) => {
          if (changed.includes("flight")) show();
          if (shown) shown.follow(changed);
        });
        fusetune.theme.subscribe(() => shown && shown.recolour());
      },
      { rootMargin: "400px 0px" },
    );
    seen.observe(place);
  }

  /* All that is shown of a flight, in `body`. */
  function build(model, body) {
    const { h } = viewer;
    const axis = viewer.makeTimeAxis(model);
    const view = {
      model,
      axis,
      colours: viewer.readColours(),
      sets: new Set(),
      isShown: (set) => set === null || set === undefined || view.sets.has(set),
      showsGate: () => fusetune.state.get("gate") === "1",
      telling: (t, digits) => told(model, t, digits),
    };
    let gone = false;
    readState();

    const changed = (given) => fusetune.state.set(given);
    const chips = viewer.makeSetChips(view, (names) => changed({ sets: setsToState(model, names) }));
    const toolbar = viewer.makeToolbar(view);
    const strip = viewer.makeStrip(view);
    const map = viewer.makeMap(view, (by) => changed({ map: by === "height" ? null : by }));
    const height = heightPanel(view);
    const groups = viewer.makeGroups(view, { changed });
    const sticky = h("div", { class: "fv-sticky" }, toolbar.element, strip.element);
    const findings = viewer.makeFindings(view);
    const aside = h("div", { class: "fv-aside" }, map && map.element, height && height.element, findings);
    const columns = h(
      "div",
      { class: aside.children.length ? "fv-columns" : "fv-columns is-single" },
      aside,
      groups.element,
    );
    body.replaceChildren(...(model.sets.size ? [chips.element] : []), sticky, columns);
    viewer.addKeys(body, axis);
    if (map) map.colourBy(fusetune.state.get("map"));

    function readState() {
      const given = fusetune.state.get("sets");
      const names =
        given === undefined
          ? model.usualSets()
          : given
              .split(",")
              .map(unescaped)
              .filter((name) => model.sets.has(name));
      view.sets = new Set(names);
      const [from, to] = (fusetune.state.get("t") || "").split(",").map(Number);
      if (to > from) axis.setWindow(from, to);
      else axis.reset();
    }

    const waiting = new Set();
    function refresh(what) {
      if (!waiting.size) requestAnimationFrame(act);
      waiting.add(what);
    }

    function act() {
      if (gone) return;
      for (const what of ["theme", "sets", "window", "cursor"]) if (waiting.has(what)) parts(what);
      waiting.clear();
      toolbar.tell();
      strip.redraw();
      if (map) map.refresh();
    }

    function parts(what) {
      groups.refresh(what);
      if (height) height.refresh(what);
      if (what === "sets") chips.tell();
    }

    axis.subscribe((what) => {
      if (what === "window") {
        const ends = [axis.from, axis.to].map((t) => Number(t.toFixed(4)));
        changed({ t: axis.isHome() ? null : ends.join(",") });
      }
      refresh(what);
    });

    function fit() {
      const width = sticky.clientWidth;
      if (!width || gone) return;
      strip.resize(width);
      // what sticks stands below the page's tabs, which stick as well, and above what sticks beside the panels
      const tabs = document.querySelector(".tab-bar");
      body.style.setProperty("--fv-below-tabs", `${tabs ? tabs.offsetHeight : 0}px`);
      body.style.setProperty("--fv-below-strip", `${(tabs ? tabs.offsetHeight : 0) + sticky.offsetHeight}px`);
      if (map) map.draw(map.element.querySelector(".fv-plot").clientWidth);
      if (height) height.draw(height.element.querySelector(".fv-plot").clientWidth);
      groups.resize();
      toolbar.tell();
    }
    const sized = new ResizeObserver(fit);
    sized.observe(columns);

    function follow(keys) {
      if (keys.includes("sets") || keys.includes("t")) readState();
      if (keys.includes("sets")) refresh("sets");
      if (keys.some((key) => ["open", "source", "axis", "log"].includes(key))) groups.follow();
      if (keys.includes("gate")) refresh("sets");
      if (keys.includes("map") && map) map.colourBy(fusetune.state.get("map"));
    }

    function recolour() {
      view.colours = viewer.readColours();
      refresh("theme");
    }

    const paper = toPaper(
      view,
      () => {
        strip.resize(PAPER_PX);
        if (map) map.draw(MAP_ON_PAPER_PX);
        if (height) {
          height.draw(PAPER_PX);
          height.refresh("theme");
        }
        groups.print(PAPER_PX);
      },
      () => {
        fit();
        groups.afterPrint();
        refresh("theme");
      },
      () => !gone && body.isConnected,
    );

    return {
      follow,
      recolour,
      destroy() {
        gone = true;
        sized.disconnect();
        groups.destroy();
        if (height) height.destroy();
        paper.stop();
      },
    };
  }

  /* Canvases hold what was drawn, so before printing they are drawn anew: so wide as paper, and dark on light. */
  function toPaper(view, before, after, isThere) {
    const root = document.documentElement;
    let theme = null;
    const start = () => {
      if (!isThere()) return;
      theme = root.dataset.theme;
      root.dataset.theme = "light";
      view.colours = viewer.readColours();
      before();
    };
    const end = () => {
      if (!isThere() || theme === null) return;
      root.dataset.theme = theme;
      theme = null;
      view.colours = viewer.readColours();
      after();
    };
    addEventListener("beforeprint", start);
    addEventListener("afterprint", end);
    return {
      stop() {
        removeEventListener("beforeprint", start);
        removeEventListener("afterprint", end);
      },
    };
  }

  function heightPanel(view) {
    const { track } = view.model;
    if (!track) return null;
    const series = [{ label: "height", set: null, style: 0, time: track.time, value: track.height }];
    if (track.gnss_height !== undefined && track.gnss_height !== null) {
      series.push({
        label: "GNSS",
        set: null,
        style: 2,
        time: track.gnss_time,
        value: track.gnss_height,
        draw: "points",
      });
    }
    return viewer.makePanel(view, { id: "height", title: "Height above take-off", unit: "m", kind: "line", series });
  }

  function told(model, t, digits = 1) {
    const parts = [model.moment(t, digits)];
    const high = model.height(t);
    if (!Number.isNaN(high)) parts.push(`height ${viewer.words.figure(high)} m`);
    const mode = model.bandAt("nav_state", t);
    if (mode) parts.push(mode);
    return parts.join(", ");
  }

  const escaped = (name) => name.replace(/%/g, "%25").replace(/,/g, "%2C");
  const unescaped = (name) => name.replace(/%2C/g, ",").replace(/%25/g, "%");

  /* Nothing for the usual ones; an empty text for none. */
  function setsToState(model, names) {
    const usual = model.usualSets();
    const same = usual.length === names.length && usual.every((name) => names.includes(name));
    return same ? null : names.map(escaped).join(",");
  }
})();
