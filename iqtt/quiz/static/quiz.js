// Keys A to C or 1 to 3, the time per answer, and one answer per question. Without it the quiz works
// all the same, with the mouse and the Tab key; then no time is sent.
"use strict";

const form = document.getElementById("answers");
const buttons = [...form.querySelectorAll("button")];
let shown = null; // when all images could be seen, milliseconds
let sent = false;

// A picture is on the screen one frame after it was decoded.
Promise.all([...document.images].map((image) => image.decode().catch(() => {}))).then(() =>
  requestAnimationFrame(() => {
    shown = performance.now();
  }),
);

form.addEventListener("submit", (event) => {
  if (sent) {
    event.preventDefault();
    return;
  }
  sent = true;
  if (shown !== null) {
    form.elements.ms.value = (performance.now() - shown).toFixed(1);
  }
});

document.addEventListener("keydown", (event) => {
  if (event.repeat || event.ctrlKey || event.altKey || event.metaKey) {
    return;
  }
  const key = event.key.toLowerCase();
  const chosen = buttons["abc".indexOf(key)] ?? buttons["123".indexOf(key)];
  if (chosen) {
    event.preventDefault();
    chosen.click();
  }
});

// A browser that goes back may show a page of before from its memory: the server knows better.
window.addEventListener("pageshow", (event) => {
  if (event.persisted) {
    location.reload();
  }
});
