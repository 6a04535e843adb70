/* Words of the field: told where the pointer rests, on focus or on a tap; Escape takes the words away. */
(() => {
  "use strict";
  fusetune.onReady(() => {
    const tip = document.createElement("div");
    tip.id = "term-tip";
    tip.setAttribute("role", "tooltip");
    tip.hidden = true;
    document.body.append(tip);
    let shown = null;

    function show(term) {
      const told = document.getElementById(`term-${term.dataset.term}`);
      if (!told) return;
      hide();
      shown = term;
      tip.textContent = told.textContent;
      tip.hidden = false;
      term.setAttribute("aria-describedby", tip.id);
      const at = term.getBoundingClientRect();
      const width = document.documentElement.clientWidth;
      const left = Math.min(Math.max(8, at.left), Math.max(8, width - tip.offsetWidth - 8));
      const above = at.bottom + tip.offsetHeight + 8 > innerHeight && at.top > tip.offsetHeight + 8;
      tip.style.left = `${left + scrollX}px`;
      tip.style.top = `${(above ? at.top - tip.offsetHeight - 6 : at.bottom + 6) + scrollY}px`;
    }

    function hide() {
      if (shown) shown.removeAttribute("aria-describedby");
      shown = null;
      tip.hidden = true;
    }

    const termOf = (event) => event.target.closest && event.target.closest("dfn.term");
    for (const kind of ["pointerover", "focusin", "click"]) {
      document.addEventListener(kind, (event) => {
        const term = termOf(event);
        if (term) show(term);
        else if (kind === "click" || (kind === "pointerover" && shown && shown !== document.activeElement && event.target !== tip)) hide();
      });
    }
    document.addEventListener("focusout", hide);
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape") hide();
    });
    fusetune.state.subscribe(hide);
  });
})();
