/* What was found on the flight, and what happened: a list that leads to the moment. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const MOST = 8;
  const SEVERITIES = ["fail", "warning", "note", "pass"];

  viewer.makeFindings = (view) => {
    const { model, axis } = view;
    const { h } = viewer;
    const worst = (mark) => SEVERITIES.indexOf(mark.severity);
    const sorted = [...model.marks].sort((a, b) => worst(a) - worst(b) || a.t0 - b.t0);
    const findings = sorted.map((mark) =>
      h(
        "li",
        {},
        h(
          "button",
          {
            type: "button",
            class: `fv-finding is-${mark.severity}`,
            "data-finding": mark.id,
            onclick: () => axis.jump(mark.t0, mark.t1),
          },
          h("b", {}, mark.severity),
          " ",
          mark.title,
          h("small", {}, whole(mark, model) ? "the whole flight" : model.span(mark.t0, mark.t1)),
        ),
      ),
    );
    const events = model.events.map((event) =>
      h(
        "li",
        {},
        h(
          "button",
          {
            type: "button",
            class: "fv-finding",
            onclick: () => axis.jump(event.t, event.t),
          },
          event.title,
          h("small", {}, model.moment(event.t)),
        ),
      ),
    );
    if (!findings.length && !events.length) return null;
    return h(
      "section",
      { class: "fv-findings", "aria-label": "Findings and events" },
      findings.length ? h("h4", {}, "Findings") : null,
      list(findings, "findings"),
      events.length ? h("h4", {}, "Events") : null,
      list(events, "events"),
    );
  };

  const whole = (mark, model) => mark.t1 - mark.t0 > 0.95 * model.airTime();

  function list(items, what) {
    const { h } = viewer;
    if (items.length <= MOST) return items.length ? h("ul", {}, items) : null;
    const rest = h("ul", {}, items.slice(MOST - 2));
    const { button } = viewer.discloser(`${items.length - MOST + 2} more ${what}`, rest, {
      className: "fv-quiet-button",
    });
    return [h("ul", {}, items.slice(0, MOST - 2)), button, rest];
  }
})();
