/** The list of targets. */

const STATE_TEXTS = { tracking: "tracking", lost: "LOST", found: "FOUND" };
const WAITING = "waiting";

/**
 * @typedef {object} Handlers
 * @property {(id: number) => void} select
 * @property {(id: number, name: string) => Promise<unknown>} [rename] undefined if it failed;
 *   without it, names cannot be changed
 * @property {(id: number) => void} remove
 */

/** Keeps one list item per target up to date. */
export class TargetList {
  #rows = new Map();
  #list;
  #empty;
  #handlers;

  /** @param {HTMLElement} list @param {HTMLElement} empty @param {Handlers} handlers */
  constructor(list, empty, handlers) {
    this.#list = list;
    this.#empty = empty;
    this.#handlers = handlers;
  }

  /**
   * @param {(import("./steps.js").Target & {note?: string})[]} targets a target with a note is not
   *   tracked yet; the note says when it begins
   * @param {(target: object) => "tracking" | "lost" | "found"} stateOf
   * @param {(target: object) => string} errorOf "" if there is none
   * @param {number | null} selected
   */
  update(targets, stateOf, errorOf, selected) {
    const ids = new Set(targets.map(({ id }) => id));
    for (const [id, row] of this.#rows) {
      if (ids.has(id)) continue;
      row.item.remove();
      this.#rows.delete(id);
    }
    for (const target of targets) {
      if (!this.#rows.has(target.id)) this.#rows.set(target.id, this.#add(target));
      const row = this.#rows.get(target.id);
      const state = target.note === undefined ? stateOf(target) : WAITING;
      updateRow(row, target, state, target.id === selected);
      row.error.textContent = errorOf(target);
      row.error.hidden = row.error.textContent === "";
    }
    this.#empty.hidden = targets.length > 0;
  }

  #add({ id, colour: color }) {
    const row = makeRow(color);
    row.item.addEventListener("pointerdown", () => this.#handlers.select(id));
    row.swatch.addEventListener("click", () => this.#handlers.select(id));
    row.name.addEventListener("focus", () => this.#handlers.select(id));
    row.name.readOnly = !this.#handlers.rename;
    row.name.addEventListener("change", () => this.#rename(id, row));
    row.name.addEventListener("blur", () => this.#restore(row));
    row.name.addEventListener("keydown", (event) => onNameKey(event, row));
    row.remove.addEventListener("click", () => this.#handlers.remove(id));
    this.#list.append(row.item);
    return row;
  }

  async #rename(id, row) {
    const name = row.name.value.trim().replace(/\s+/g, " ");
    if (!name || name === row.knownName || !this.#handlers.rename) return;
    row.isSent = true;
    const answer = await this.#handlers.rename(id, name);
    row.isSent = false;
    if (answer === undefined) this.#restore(row);
  }

  /** Show the session's name again, unless a new one has been sent. */
  #restore(row) {
    if (!row.isSent) row.name.value = row.knownName;
  }
}

/** Enter commits a name, Escape cancels it. */
function onNameKey(event, row) {
  if (event.key === "Escape") row.name.value = row.knownName;
  if (event.key === "Escape" || event.key === "Enter") row.name.blur();
}

function updateRow(row, target, state, selected) {
  const { name, score, note } = target;
  if (row.knownName !== name) setName(row, name);
  row.item.dataset.state = state;
  row.item.classList.toggle("selected", selected);
  row.swatch.setAttribute("aria-pressed", String(selected));
  row.state.textContent = note ?? STATE_TEXTS[state];
  row.meter.hidden = row.number.hidden = state === WAITING;
  if (state === WAITING) return;
  const percent = Math.round(Math.min(Math.max(score, 0), 1) * 100);
  row.meter.setAttribute("aria-valuenow", String(percent));
  row.bar.style.transform = `scaleX(${percent / 100})`;
  row.number.textContent = score.toFixed(2);
}

function setName(row, name) {
  row.knownName = name;
  if (document.activeElement !== row.name) row.name.value = name;
  row.swatch.setAttribute("aria-label", `Select ${name}`);
  row.name.setAttribute("aria-label", `Name of ${name}`);
  row.meter.setAttribute("aria-label", `Score of ${name}`);
  row.remove.setAttribute("aria-label", `Remove ${name}`);
}

function makeRow(color) {
  const item = make("li", "target");
  const swatch = make("button", "swatch", { type: "button" });
  const name = make("input", "name", { type: "text", maxLength: 40, spellcheck: false });
  name.autocomplete = "off";
  const state = make("span", "state");
  const meter = make("span", "meter");
  for (const [key, value] of [["role", "meter"], ["aria-valuemin", "0"], ["aria-valuemax", "100"]]) {
    meter.setAttribute(key, value);
  }
  const bar = make("span", "bar");
  const number = make("span", "number");
  const remove = make("button", "remove quiet", { type: "button", textContent: "×" });
  const error = make("span", "problem", { hidden: true });
  swatch.style.backgroundColor = bar.style.backgroundColor = color;
  meter.append(bar);
  item.append(swatch, name, state, meter, number, remove, error);
  return { item, swatch, name, state, meter, bar, number, remove, error, knownName: null, isSent: false };
}

function make(tag, className, properties = {}) {
  return Object.assign(document.createElement(tag), { className, ...properties });
}
