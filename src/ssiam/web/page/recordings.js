/** The list of recordings with their files, and a player. */

import { withToken } from "./socket.js";

const VIDEO = "video.mp4";

/** @typedef {{name: string, frames: number, seconds: number, open: boolean, error: string | null, files: string[]}} Recording */

export class Recordings {
  #list = document.getElementById("recordings");
  #empty = document.getElementById("no-recordings");
  #player = document.getElementById("player");
  #title = document.getElementById("player-name");
  #video = document.getElementById("video");

  /** @param {(message: string) => void} failed */
  constructor(failed) {
    document.getElementById("player-close").addEventListener("click", () => this.close());
    this.#video.addEventListener("error", () => {
      if (this.#video.hasAttribute("src")) failed(`${this.#title.textContent} cannot be played in this browser.`);
    });
  }

  /** @param {Recording[]} recordings */
  update(recordings) {
    this.#list.replaceChildren(...recordings.map((recording) => this.#item(recording)));
    this.#empty.hidden = recordings.length > 0;
    const playing = this.#title.textContent;
    if (playing && !recordings.some(({ name }) => name === playing)) this.close();
  }

  /** Play a recorded video. */
  play(name) {
    this.#player.hidden = false;
    this.#title.textContent = name;
    this.#video.src = urlOf(name, VIDEO);
    this.#player.scrollIntoView({ block: "nearest" });
    // A browser may require another click, for which the player has a button.
    this.#video.play().catch(() => this.#video.focus());
  }

  close() {
    this.#player.hidden = true;
    this.#title.textContent = "";
    this.#video.removeAttribute("src");
    this.#video.load();
  }

  #item({ name, frames, seconds, open, error, files }) {
    const item = document.createElement("li");
    const length = open ? "recording…" : `${seconds.toFixed(1)} s, ${frames} frames`;
    item.append(text("span", "title", name), text("span", "muted", length));
    if (error) item.append(text("span", "problem", error));
    if (open) return item;
    const links = text("p", "files", "");
    if (files.includes(VIDEO)) links.append(this.#playButton(name));
    links.append(...files.map((file) => downloadLink(name, file)));
    item.append(links);
    return item;
  }

  #playButton(name) {
    const button = text("button", "play", "Play");
    button.type = "button";
    button.setAttribute("aria-label", `Play ${name}`);
    button.addEventListener("click", () => this.play(name));
    return button;
  }
}

function downloadLink(name, file) {
  const link = text("a", "", file);
  link.href = urlOf(name, file);
  link.download = `${name}-${file}`;
  return link;
}

function urlOf(name, file) {
  return withToken(`/recordings/${encodeURIComponent(name)}/${encodeURIComponent(file)}`);
}

function text(tag, className, content) {
  return Object.assign(document.createElement(tag), { className, textContent: content });
}
