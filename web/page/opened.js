// Not a module, since browsers load modules from web servers only.
"use strict";
// A script that is not there.
addEventListener("error", ({ target }) => {
  if (target instanceof HTMLScriptElement) {
    document.getElementById("status").textContent = "A part of this page is missing; load it again, or build it again.";
  }
}, true);
addEventListener("DOMContentLoaded", () => {
  const status = document.getElementById("status");
  if (location.protocol === "file:") {
    status.textContent = "This page was opened as a file, and browsers load its parts from web servers only. " +
      "Run `python3 -m http.server` in its folder, and open http://localhost:8000/.";
  } else if (typeof WebAssembly !== "object") {
    status.textContent = "This browser has no WebAssembly, or it is switched off, so nothing can be computed here. " +
      "Use another browser, or the program curvelax.";
  }
});
