/* What the reader looks at, kept in the address's fragment (#tab=flights&flight=…), so that a view can be shared. */
(() => {
  "use strict";
  const fusetune = (globalThis.fusetune = globalThis.fusetune || {});
  const WRITE_AFTER_MS = 150; // browsers refuse an address that changes with every move of a pointer
  const listeners = [];
  let values = read();
  let waiting = 0;

  function read() {
    const found = new Map();
    for (const part of location.hash.slice(1).split("&")) {
      const at = part.indexOf("=");
      if (at > 0) found.set(decode(part.slice(0, at)), decode(part.slice(at + 1)));
    }
    return found;
  }

  function decode(text) {
    try {
      return decodeURIComponent(text);
    } catch {
      return text;
    }
  }

  function address() {
    const parts = [...values].map(([key, value]) => `${encode(key)}=${encode(value)}`);
    return parts.length ? `#${parts.join("&")}` : location.pathname + location.search;
  }

  function encode(text) {
    return encodeURIComponent(text).replace(/%2C/g, ",");
  }

  function change(given) {
    const changed = [];
    for (const [key, value] of Object.entries(given)) {
      const now = value === null || value === undefined ? undefined : String(value);
      if (values.get(key) === now) continue;
      if (now === undefined) values.delete(key);
      else values.set(key, now);
      changed.push(key);
    }
    return changed;
  }

  function tell(changed) {
    if (changed.length) listeners.forEach((listener) => listener(changed));
  }

  function write() {
    clearTimeout(waiting);
    waiting = 0;
    history.replaceState(null, "", address());
  }

  function followAddress() {
    const before = values;
    values = read();
    const keys = new Set([...before.keys(), ...values.keys()]);
    tell([...keys].filter((key) => before.get(key) !== values.get(key)));
  }

  addEventListener("popstate", followAddress);

  fusetune.state = {
    get: (key) => values.get(key),
    set(given) {
      const changed = change(given);
      if (changed.length && !waiting) waiting = setTimeout(write, WRITE_AFTER_MS);
      tell(changed);
    },
    push(given) {
      if (waiting) write();
      const changed = change(given);
      if (changed.length) history.pushState(null, "", address());
      tell(changed);
    },
    subscribe: (listener) => listeners.push(listener),
  };

  fusetune.onReady = (run) => {
    if (document.readyState === "loading") addEventListener("DOMContentLoaded", run, { once: true });
    else run();
  };

  fusetune.css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
})();
