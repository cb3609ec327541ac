// Steps through the frames: by keys, and by playing.

const PAUSE = 120; // ms at least for a frame
const STEPS = { ArrowRight: 1, ArrowLeft: -1, PageDown: 10, PageUp: -10, Home: -1e9, End: 1e9 };

export class Player {
  // `step(by)` moves by frames; `next()` shows the next frame and resolves when it stands.
  constructor(button, { step, next }) {
    Object.assign(this, { button, step, next, playing: false });
    button.addEventListener("click", () => this.toggle());
  }

  async toggle(on = !this.playing) {
    if (on === this.playing) return;
    this.playing = on;
    this.button.textContent = on ? "❚❚" : "▶";
    this.button.setAttribute("aria-pressed", String(on));
    while (this.playing) await Promise.all([this.next(), new Promise((done) => { setTimeout(done, PAUSE); })]);
  }

  // Whether a key was one of ours.
  pressed(event) {
    const { target, key } = event;
    if (event.ctrlKey || event.altKey || event.metaKey || target.closest("dialog")) return false;
    if (["SELECT", "INPUT"].includes(target.tagName) && target.id !== "frame") return false;
    if (key in STEPS) this.step(STEPS[key]);
    else if (key === " " && target.tagName !== "BUTTON") this.toggle();
    else return false;
    event.preventDefault();
    return true;
  }
}
