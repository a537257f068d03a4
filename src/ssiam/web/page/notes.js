/** Notes that come and go, the banner of a lost connection, and what is only said. */

const STAY = { info: 5000, warning: 8000, error: 10_000 }; // milliseconds
const MOST = 4;

const byId = (id) => document.getElementById(id);

/** @param {"info" | "warning" | "error"} level @param {string} message */
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
  while (toasts.children.length > MOST) toasts.firstChild.remove();
  setTimeout(() => note.remove(), STAY[level] ?? STAY.info);
}

/** Tell those who cannot see the picture. */
export function announce(sentence) {
  byId("announce").textContent = sentence;
}

/** Show that the connection is lost, or that nothing is tracked; null takes the banner away. */
export function banner(message, { retry = true } = {}) {
  byId("banner").hidden = message === null;
  byId("banner-button").hidden = !retry;
  // An alert is read again whenever it is written.
  if (byId("banner-text").textContent !== (message ?? "")) {
    byId("banner-text").textContent = message ?? "";
  }
}

/** A line over the picture; "" takes it away. */
export function hint(text) {
  byId("hint").textContent = text;
  byId("hint").hidden = text === "";
}
