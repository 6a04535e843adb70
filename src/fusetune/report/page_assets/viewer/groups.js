/* Panels in groups that open and close. What is closed or far from view is not drawn. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const OPEN_AT_FIRST = ["Innovations"];
  const NEAR = "300px 0px";
  const BY_SOURCE = ["Innovations", "Test ratios"];

  /* What titles begin with alike: "GNSS velocity" of "GNSS velocity north" and "… east". */
  function commonWords(titles) {
    const [first, ...others] = titles.map((title) => title.split(",")[0].split(" "));
    const same = first.filter((word, i) =>
      others.every((words) => words.slice(0, i + 1).join(" ") === first.slice(0, i + 1).join(" ")),
    );
    return (same.length ? same : first).join(" ");
  }

  viewer.makeGroups = (view, { changed }) => {
    const { model } = view;
    const { h } = viewer;
    const near = new Set();
    const stale = new Map();
    const byElement = new Map();
    const watch = new IntersectionObserver(
      (entries) => {
        for (const { target, isIntersecting } of entries) {
          const panel = byElement.get(target);
          if (!panel) continue;
          if (!isIntersecting) near.delete(panel);
          else {
            near.add(panel);
            bring(panel);
          }
        }
      },
      { rootMargin: NEAR },
    );
    const groups = model.groups.map(makeGroup);
    const element = h(
      "div",
      { class: "fv-groups" },
      groups.map((group) => group.element),
    );

    function makeGroup(name) {
      const own = model.panels.filter((panel) => panel.group === name && panel.series.length);
      const content = h("div", { class: "fv-group-content" });
      const bands = name === "Flags" ? model.bands : [];
      const count = own.length + (bands.length ? 1 : 0);
      const open = openNow().includes(name);
      const { button, set } = viewer.discloser(
        [name, h("small", {}, count === 1 ? "1 panel" : `${count} panels`)],
        content,
        { open, className: "fv-group-button", changed: () => changed({ open: listed() }) },
      );
      const group = { name, own, bands, content, set, panels: null, filter: null };
      group.element = h(
        "section",
        { class: "fv-group", "data-group": name, "aria-label": name },
        h("h3", {}, button),
        content,
        h("p", { class: "fv-print-hint" }, `${name}: closed when this was printed.`),
      );
      if (open) fill(group);
      return group;
    }

    function openNow() {
      const given = fusetune.state.get("open");
      if (given !== undefined) return given.split(",");
      return OPEN_AT_FIRST.some((name) => model.groups.includes(name)) ? OPEN_AT_FIRST : model.groups.slice(0, 1);
    }

    function listed() {
      const open = groups.filter((group) => !group.content.hidden).map((group) => group.name);
      const usual = openUsually();
      return open.length === usual.length && open.every((name) => usual.includes(name)) ? null : open.join(",");
    }

    function openUsually() {
      const usual = OPEN_AT_FIRST.filter((name) => model.groups.includes(name));
      return usual.length ? usual : model.groups.slice(0, 1);
    }

    /* The panels of a group that has been opened. */
    function fill(group) {
      if (group.panels) return;
      group.panels = group.own.map((panel) => viewer.makePanel(view, panel));
      if (group.bands.length) group.panels.push(viewer.makeBands(view, group.bands));
      const tools = toolsOf(group);
      group.content.replaceChildren(...(tools ? [tools] : []), ...group.panels.map((panel) => panel.element));
      for (const panel of group.panels) {
        byElement.set(panel.element, panel);
        watch.observe(panel.element);
      }
      select(group);
    }

    function toolsOf(group) {
      const parts = [];
      if (BY_SOURCE.includes(group.name)) {
        const sources = [...new Set(group.own.map((panel) => panel.source))].filter(Boolean);
        if (sources.length > 1) parts.push(sourceChips(group, sources));
      }
      const any = (test) => group.own.some((panel) => panel.series.some(test));
      const isGated = any((series) => series.gate);
      if (any((series) => series.sigma !== null && series.sigma !== undefined)) {
        parts.push(
          h("span", { class: "fv-quiet" }, isGated ? "shade: ±1 σ · dashed: gate · ×: rejected" : "shade: ±1 σ"),
        );
      }
      if (isGated) {
        parts.push(
          checkbox(
            "whole gate in view",
            () => view.showsGate(),
            (on) => changed({ gate: on ? "1" : null }),
          ),
        );
      }
      if (group.own.some((panel) => panel.kind === "ratio")) {
        parts.push(
          checkbox(
            "logarithmic",
            () => group.panels.some((panel) => panel.isLog && panel.isLog()),
            (on) => changed({ log: on ? "1" : "0" }),
          ),
        );
      }
      return parts.length ? h("div", { class: "fv-tools" }, parts) : null;
    }

    function sourceChips(group, sources) {
      const titles = (source) => group.own.filter((panel) => panel.source === source).map((panel) => panel.title);
      const words = (source) => (source ? viewer.words.heading(commonWords(titles(source))) : "All sources");
      group.filter = [null, ...sources].map((source) => ({
        source,
        button: h(
          "button",
          {
            type: "button",
            class: "fv-chip",
            "data-source": source,
            onclick: () => changed({ source, axis: null }),
          },
          words(source),
        ),
      }));
      const buttons = group.filter.map(({ button }) => button);
      return h("span", { class: "fv-sources", role: "group", "aria-label": "Source" }, buttons);
    }

    function checkbox(label, get, act) {
      const input = h("input", { type: "checkbox", onchange: () => act(input.checked) });
      input.checked = get();
      return h("label", { class: "fv-check" }, input, label);
    }

    /* Shows of a group the panels of the source (and axis) that the address names; all where it names none of its. */
    function select(group) {
      const source = fusetune.state.get("source") || null;
      const axis = fusetune.state.get("axis");
      const has = source !== null && group.own.some((panel) => panel.source === source);
      for (const { panel, element: at } of group.panels) {
        if (!panel || !BY_SOURCE.includes(group.name)) continue;
        const other = has && (panel.source !== source || (axis !== undefined && String(panel.axis) !== axis));
        at.hidden = other;
      }
      for (const one of group.filter || [])
        one.button.setAttribute("aria-pressed", String(one.source === (has ? source : null)));
      const log = fusetune.state.get("log");
      for (const panel of group.panels) {
        if (log !== undefined && panel.panel && panel.panel.kind === "ratio" && panel.isLog() !== (log === "1"))
          panel.setLog(log === "1");
      }
    }

    const widthOf = (panel) => panel.element.querySelector(".fv-plot").clientWidth;

    function bring(panel) {
      const width = widthOf(panel);
      if (!width) return;
      panel.draw(width);
      const missed = stale.get(panel);
      if (missed) missed.forEach((what) => panel.refresh(what));
      else panel.refresh("cursor");
      stale.delete(panel);
    }

    function refresh(what) {
      for (const group of groups) {
        for (const panel of group.panels || []) {
          if (near.has(panel) || what === "sets")
            panel.refresh(what); // legends are read out of view as well
          else stale.set(panel, (stale.get(panel) || new Set()).add(what));
        }
      }
    }

    function follow() {
      const open = openNow();
      for (const group of groups) {
        const is = open.includes(group.name);
        if (is) fill(group);
        if (group.content.hidden === is) group.set(is);
        if (group.panels) select(group);
      }
    }

    const drawn = () => groups.flatMap((group) => (group.content.hidden ? [] : group.panels || []));
    return {
      element,
      refresh,
      follow,
      resize: () => near.forEach(bring),
      /* On paper: every panel of the open groups, drawn so wide. */
      print(width) {
        for (const panel of drawn()) {
          if (panel.element.hidden) continue;
          panel.draw(width);
          ["theme", "window", "cursor"].forEach((what) => panel.refresh(what));
        }
      },
      afterPrint: () => drawn().forEach((panel) => panel.isDrawn() && bring(panel)),
      destroy() {
        watch.disconnect();
        groups.forEach((group) => (group.panels || []).forEach((panel) => panel.destroy()));
      },
    };
  };
})();
