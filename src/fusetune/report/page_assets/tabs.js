/* Tabs: one panel at a time, by pointer, arrow keys, or a link to whatever stands in a panel. */
(() => {
  "use strict";
  document.documentElement.classList.add("js");

  fusetune.onReady(() => {
    const tabs = [...document.querySelectorAll("[role=tab]")];
    const panels = tabs.map((tab) => document.getElementById(tab.getAttribute("aria-controls")));
    const names = tabs.map((tab) => tab.dataset.tab);

    function show(index) {
      tabs.forEach((tab, at) => {
        tab.setAttribute("aria-selected", String(at === index));
        tab.tabIndex = at === index ? 0 : -1;
        panels[at].classList.toggle("is-open", at === index);
      });
      const bar = tabs[index].parentElement;
      bar.scrollLeft = tabs[index].offsetLeft - (bar.clientWidth - tabs[index].offsetWidth) / 2;
    }

    function open(index) {
      fusetune.state.push({ tab: index === 0 ? null : names[index], at: null });
      scrollTo({ top: 0 });
    }

    /* Shows what an id names: its tab, the closed parts around it, and itself. */
    function reveal(id) {
      const target = document.getElementById(id);
      if (!target) return;
      for (let part = target.closest("details"); part; part = part.parentElement.closest("details")) part.open = true;
      target.scrollIntoView({ block: "start" });
      if (!target.hasAttribute("tabindex")) target.tabIndex = -1;
      target.focus({ preventScroll: true });
    }

    function follow(changed) {
      if (tabs.length && changed.includes("tab")) show(Math.max(0, names.indexOf(fusetune.state.get("tab"))));
      const at = fusetune.state.get("at");
      if (at && (changed.includes("at") || changed.includes("tab"))) reveal(at);
    }

    tabs.forEach((tab, index) => {
      tab.addEventListener("click", (event) => {
        event.preventDefault();
        open(index);
      });
      tab.addEventListener("keydown", (event) => {
        const last = tabs.length - 1;
        const to = { ArrowRight: index === last ? 0 : index + 1, ArrowLeft: index === 0 ? last : index - 1, Home: 0, End: last };
        if (!(event.key in to)) return;
        event.preventDefault();
        open(to[event.key]);
        tabs[to[event.key]].focus();
      });
    });

    document.addEventListener("click", (event) => {
      const link = event.target.closest && event.target.closest('a[href^="#"]:not([role=tab])');
      if (!link) return;
      event.preventDefault();
      const target = document.getElementById(decodeURIComponent(link.getAttribute("href").slice(1)));
      if (!target) return;
      const panel = target.closest("[role=tabpanel]");
      const index = panels.indexOf(panel);
      const more = Object.fromEntries(new URLSearchParams(link.dataset.state || ""));
      fusetune.state.push({ tab: index > 0 ? names[index] : null, at: target.id, ...more });
      reveal(target.id); // again, though the address names it already
    });

    fusetune.state.subscribe(follow);
    if (tabs.length) show(Math.max(0, names.indexOf(fusetune.state.get("tab"))));
    if (fusetune.state.get("at")) reveal(fusetune.state.get("at"));
  });

  /* On paper everything is open; afterwards it is as it was. */
  let opened = [];
  addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open])")];
    opened.forEach((part) => (part.open = true));
  });
  addEventListener("afterprint", () => opened.splice(0).forEach((part) => (part.open = false)));
})();
