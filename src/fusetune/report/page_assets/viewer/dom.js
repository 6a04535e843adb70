/* Elements, made without markup, so that no text of a log can become any. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const SVG = "http://www.w3.org/2000/svg";
  let made = 0;

  /* An element; of `options` on… are listeners, what is false or null is left out, the rest attributes. */
  function h(tag, options = {}, ...children) {
    return filled(document.createElement(tag), options, children);
  }

  function svg(tag, options = {}, ...children) {
    return filled(document.createElementNS(SVG, tag), options, children);
  }

  function filled(element, options, children) {
    for (const [name, value] of Object.entries(options)) {
      if (value === false || value === null || value === undefined) continue;
      if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
      else element.setAttribute(name, value === true ? "" : value);
    }
    element.append(
      ...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false),
    );
    return element;
  }

  function uniqueId(stem) {
    made += 1;
    return `fv-${stem}-${made}`;
  }

  /* A button that opens and closes `region`. Not <details>: those the page opens for print, these stay as they are. */
  function discloser(label, region, { open = false, className = "fv-disclose", changed = () => {} } = {}) {
    region.id = region.id || uniqueId("region");
    const button = h("button", { type: "button", class: className, "aria-controls": region.id }, label);
    function set(now) {
      button.setAttribute("aria-expanded", String(now));
      region.hidden = !now;
    }
    button.addEventListener("click", () => {
      set(region.hidden);
      changed(!region.hidden);
    });
    set(open);
    return { button, set };
  }

  function table(head, rows, caption) {
    return h(
      "div",
      { class: "fv-scroll", tabindex: "0", role: "region", "aria-label": caption },
      h(
        "table",
        { class: "fv-table" },
        h("caption", {}, caption),
        h(
          "thead",
          {},
          h(
            "tr",
            {},
            head.map((text) => h("th", { scope: "col" }, text)),
          ),
        ),
        h(
          "tbody",
          {},
          rows.map(([first, ...cells]) =>
            h(
              "tr",
              {},
              h("th", { scope: "row" }, first),
              cells.map((text) => h("td", {}, text)),
            ),
          ),
        ),
      ),
    );
  }

  Object.assign(viewer, { h, svg, uniqueId, discloser, table });
})();
