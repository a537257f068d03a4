/** Notes (toasts), the banner, the hint over the view, and announcements to screen readers. */

const DURATIONS = { info: 5000, warning: 8000, error: 10_000 }; // milliseconds
const MAX_TOASTS = 4;

const byId = (id) => document.getElementById(id);

/** Show a note. @param {"info" | "warning" | "error"} level @param {string} message */
export function toast(level, message) {
  const toasts = byId("toasts");
  const same = [...toasts.children].find((each) => each.dataset.message === message);
  same?.remove();
  const note = document.createElement("div");
  note.className = `toast ${level}`;
  note.dataset.message = message;
  const text = Object.assign(document.createElement("span"), { textContent: message });
  const close = Object.assign(document.createElement("button"), { type: "button", textContent: "×" });
  close.className = "quiet";
  close.setAttribute("aria-label", "Close this note");
  close.addEventListener("click", () => note.remove());
  note.append(text, close);
  toasts.append(note);
  while (toasts.children.length > MAX_TOASTS) toasts.firstChild.remove();
  setTimeout(() => note.remove(), DURATIONS[level] ?? DURATIONS.info);
}

/** Announce a sentence to screen readers. */
export function announce(sentence) {
  byId("announce").textContent = sentence;
}

/** Show a lasting problem in the banner; null hides it. */
export function banner(message, { retry = true } = {}) {
  byId("banner").hidden = message === null;
  byId("banner-button").hidden = !retry;
  // Screen readers read an alert again whenever its text is set.
  if (byId("banner-text").textContent !== (message ?? "")) {
    byId("banner-text").textContent = message ?? "";
  }
}

/** Show a line over the raw view; "" hides it. */
export function hint(text) {
  byId("hint").textContent = text;
  byId("hint").hidden = text === "";
}
