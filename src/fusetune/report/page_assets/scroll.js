/* Boxes that scroll sideways: reached by the keyboard where they do, and it is seen that there is more. */
(() => {
  "use strict";
  fusetune.onReady(() => {
    const boxes = [...document.querySelectorAll(".scroll")];

    function look(box) {
      const scrolls = box.scrollWidth > box.clientWidth + 1;
      box.classList.toggle("is-cut", scrolls && box.scrollLeft + box.clientWidth < box.scrollWidth - 2);
      if (scrolls) {
        box.tabIndex = 0;
        box.setAttribute("role", "group");
        box.setAttribute("aria-label", "a wide table, scrolls sideways");
      } else {
        box.removeAttribute("tabindex");
        box.removeAttribute("role");
        box.removeAttribute("aria-label");
      }
    }

    const watched = new ResizeObserver((entries) => entries.forEach((entry) => look(entry.target)));
    boxes.forEach((box) => {
      watched.observe(box);
      box.addEventListener("scroll", () => look(box), { passive: true });
    });
  });
})();
