/** Sends this device's camera to the session, one frame at a time. */

const INTERVAL = 1000 / 30; // milliseconds between frames, at least
const STEP_TIMEOUT = 1000; // milliseconds to wait for the step of a frame
const QUALITY = 0.85;
const CONSTRAINTS = {
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
   * @param {(jpeg: Blob) => boolean} send
   * @param {(on: boolean) => void} changed
   */
  constructor(send, changed) {
    this.#send = send;
    this.#changed = changed;
  }

  get on() {
    return this.#stream !== null;
  }

  /** Open the camera and start sending; rejects with a `DOMException` if that is impossible. */
  async start() {
    if (!navigator.mediaDevices) {
      throw new DOMException("browsers allow it on https:// and localhost pages only.");
    }
    this.#stream = await navigator.mediaDevices.getUserMedia(CONSTRAINTS);
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

  /** A step has arrived: send the next frame. */
  onStep() {
    if (!this.on || !this.#sentAt) return;
    this.#schedule(Math.max(0, this.#sentAt + INTERVAL - performance.now()));
    this.#sentAt = 0;
  }

  #schedule(wait) {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#capture(), wait);
  }

  #capture() {
    const { videoWidth: width, videoHeight: height } = this.#video;
    this.#schedule(STEP_TIMEOUT);
    if (!width) return;
    if (this.#canvas.width !== width || this.#canvas.height !== height) {
      Object.assign(this.#canvas, { width, height });
    }
    this.#context.drawImage(this.#video, 0, 0);
    this.#canvas.toBlob((jpeg) => this.#sendFrame(jpeg), "image/jpeg", QUALITY);
  }

  #sendFrame(jpeg) {
    if (this.on && jpeg && this.#send(jpeg)) this.#sentAt = performance.now();
  }
}

/** The button that starts and stops the camera. */
export class CameraButton {
  #button = document.getElementById("camera");
  #webcam;
  #failed;

  /**
   * @param {(jpeg: Blob) => boolean} send
   * @param {(message: string) => void} failed
   */
  constructor(send, failed) {
    this.#webcam = new Webcam(send, (on) => this.#show(on));
    this.#failed = failed;
    this.#button.addEventListener("click", () => this.#toggle());
  }

  /** Show the button if the session takes frames from browsers. */
  offer(isWebcam) {
    this.#button.hidden = !isWebcam;
    if (!isWebcam) this.#webcam.stop();
  }

  /** A step has arrived: send the next frame. */
  onStep() {
    this.#webcam.onStep();
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
