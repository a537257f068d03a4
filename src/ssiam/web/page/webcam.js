/** This device's camera, sent to the session one picture at a time. */

const PAUSE = 1000 / 30; // milliseconds between pictures, at least
const PATIENCE = 1000; // milliseconds until a picture that did not come back is given up
const QUALITY = 0.85;
const WANTED = {
  audio: false,
  video: {
    width: { ideal: 640 },
    height: { ideal: 480 },
    frameRate: { ideal: 30 },
    facingMode: { ideal: "environment" },
  },
};

class Webcam {
  #video = Object.assign(document.createElement("video"), { muted: true, playsInline: true });
  #canvas = document.createElement("canvas");
  #context = this.#canvas.getContext("2d", { alpha: false });
  #stream = null;
  #sentAt = 0;
  #timer = 0;
  #send;
  #changed;

  /**
   * @param {(picture: Blob) => boolean} send
   * @param {(on: boolean) => void} changed
   */
  constructor(send, changed) {
    this.#send = send;
    this.#changed = changed;
  }

  get on() {
    return this.#stream !== null;
  }

  /** Ask for the camera and send; rejects with a `DOMException` if it cannot be had. */
  async start() {
    if (!navigator.mediaDevices) {
      throw new DOMException("A browser gives its camera to https:// and localhost pages only.");
    }
    this.#stream = await navigator.mediaDevices.getUserMedia(WANTED);
    this.#stream.getVideoTracks()[0].addEventListener("ended", () => this.stop());
    this.#video.srcObject = this.#stream;
    await this.#video.play();
    this.#changed(true);
    this.#capture();
  }

  stop() {
    if (!this.on) return;
    clearTimeout(this.#timer);
    for (const track of this.#stream.getTracks()) track.stop();
    this.#stream = this.#video.srcObject = null;
    this.#changed(false);
  }

  /** A step came: the next picture may go. */
  cameBack() {
    if (!this.on || !this.#sentAt) return;
    this.#again(Math.max(0, this.#sentAt + PAUSE - performance.now()));
    this.#sentAt = 0;
  }

  #again(wait) {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#capture(), wait);
  }

  #capture() {
    const { videoWidth: width, videoHeight: height } = this.#video;
    this.#again(PATIENCE);
    if (!width) return;
    if (this.#canvas.width !== width || this.#canvas.height !== height) {
      Object.assign(this.#canvas, { width, height });
    }
    this.#context.drawImage(this.#video, 0, 0);
    this.#canvas.toBlob((picture) => this.#pass(picture), "image/jpeg", QUALITY);
  }

  #pass(picture) {
    if (this.on && picture && this.#send(picture)) this.#sentAt = performance.now();
  }
}

/** The button that sends this device's camera to a session that waits for pictures. */
export class CameraButton {
  #button = document.getElementById("camera");
  #webcam;
  #failed;

  /**
   * @param {(picture: Blob) => boolean} send
   * @param {(message: string) => void} failed
   */
  constructor(send, failed) {
    this.#webcam = new Webcam(send, (on) => this.#show(on));
    this.#failed = failed;
    this.#button.addEventListener("click", () => this.#toggle());
  }

  /** Whether the session has a use for it. */
  offer(wanted) {
    this.#button.hidden = !wanted;
    if (!wanted) this.#webcam.stop();
  }

  cameBack() {
    this.#webcam.cameBack();
  }

  async #toggle() {
    if (this.#webcam.on) {
      this.#webcam.stop();
      return;
    }
    this.#button.disabled = true;
    try {
      await this.#webcam.start();
    } catch (error) {
      if (!(error instanceof DOMException)) throw error;
      this.#webcam.stop();
      this.#failed(`The camera cannot be used: ${error.message}`);
    } finally {
      this.#button.disabled = false;
    }
  }

  #show(on) {
    this.#button.setAttribute("aria-pressed", String(on));
    this.#button.textContent = on ? "Stop this device's camera" : "Use this device's camera";
  }
}
