/* Which flight, and which sets of it. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const MOST_CHIPS = 12;

  /* `labels` are asked of the data one after the other, when nothing else is to be done. */
  viewer.makeFlightChoice = (names, textOf, chosen) => {
    const { h } = viewer;
    const options = names.map((name) => h("option", { value: name }, name));
    const select = h("select", { id: viewer.uniqueId("flight"), onchange: () => chosen(select.value) }, options);
    const go = (by) => chosen(names[names.indexOf(select.value) + by]);
    const before = h("button", { type: "button", "aria-label": "Flight before", onclick: () => go(-1) }, "‹");
    const after = h("button", { type: "button", "aria-label": "Flight after", onclick: () => go(1) }, "›");
    const element = h(
      "div",
      { class: "fv-flight" },
      h("label", { for: select.id }, "Flight"),
      h("span", { class: "fv-joined" }, before, select, after),
    );

    async function tellLabels() {
      for (const [at, name] of names.entries()) {
        await idle();
        try {
          options[at].textContent = (await viewer.decodeHeader(textOf(name))).label || name;
        } catch {
          /* its name says which it is */
        }
      }
    }
    if (names.length > 1) tellLabels();
    return {
      element,
      set(name) {
        select.value = name;
        before.disabled = name === names[0];
        after.disabled = name === names[names.length - 1];
      },
    };
  };

  function idle() {
    return new Promise((done) => (globalThis.requestIdleCallback ? requestIdleCallback(done) : setTimeout(done, 50)));
  }

  /* A button for each set; pressed are those that are shown. */
  viewer.makeSetChips = (view, changed) => {
    const { model } = view;
    const { h } = viewer;
    const chips = [...model.sets.values()].map((set) => {
      const role = model.roleOf(set.name);
      const button = h(
        "button",
        { type: "button", class: "fv-chip", "data-set": set.name, onclick: () => toggle(set.name) },
        viewer.swatch(set.style, set.marker),
        h("span", {}, model.labelOf(set.name)),
        role ? h("small", {}, role) : null,
      );
      return { name: set.name, button };
    });
    const more = h("button", { type: "button", class: "fv-quiet-button", onclick: () => ((closed = false), tell()) });
    let closed = chips.length > MOST_CHIPS;
    const choose = (names) => changed(model.sets.size ? names : []);
    const element = h(
      "div",
      { class: "fv-sets", role: "group", "aria-label": "Sets shown" },
      chips.map((chip) => chip.button),
      more,
      chips.length > 2
        ? h(
            "button",
            { type: "button", class: "fv-quiet-button", onclick: () => choose([...model.sets.keys()]) },
            "all",
          )
        : null,
      chips.length > 2
        ? h("button", { type: "button", class: "fv-quiet-button", onclick: () => choose(model.usualSets()) }, "usual")
        : null,
    );

    function toggle(name) {
      const now = [...model.sets.keys()].filter((one) => (one === name ? !view.isShown(one) : view.isShown(one)));
      choose(now);
    }

    function tell() {
      let hidden = 0;
      chips.forEach(({ name, button }, at) => {
        const on = view.isShown(name);
        button.setAttribute("aria-pressed", String(on));
        button.hidden = closed && !on && at >= MOST_CHIPS;
        hidden += button.hidden ? 1 : 0;
      });
      more.hidden = !hidden;
      more.textContent = `${hidden} more`;
    }
    tell();
    return { element, tell };
  };
})();
