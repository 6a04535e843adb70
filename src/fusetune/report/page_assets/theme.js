/* Light or dark: as the system has it, until the reader chooses. */
(() => {
  "use strict";
  const KEY = "fusetune-theme";
  const root = document.documentElement;
  const system = matchMedia("(prefers-color-scheme: dark)");
  const listeners = [];
  let chosen = remembered();

  function remembered() {
    try {
      return localStorage.getItem(KEY);
    } catch {
      return null; // a browser may keep nothing for a file
    }
  }

  function remember(theme) {
    try {
      localStorage.setItem(KEY, theme);
    } catch {
      /* then it holds for this view */
    }
  }

  function current() {
    return chosen || (system.matches ? "dark" : "light");
  }

  function apply() {
    root.dataset.theme = current();
    const control = document.querySelector(".theme-switch");
    if (control) {
      control.hidden = false;
      control.setAttribute("aria-pressed", String(current() === "dark"));
    }
    listeners.forEach((listener) => listener(current()));
  }

  fusetune.theme = { current, subscribe: (listener) => listeners.push(listener) };

  apply();
  system.addEventListener("change", apply);
  fusetune.onReady(() => {
    const control = document.querySelector(".theme-switch");
    if (control) {
      control.addEventListener("click", () => {
        chosen = current() === "dark" ? "light" : "dark";
        remember(chosen);
        apply();
      });
    }
    apply();
  });
})();
