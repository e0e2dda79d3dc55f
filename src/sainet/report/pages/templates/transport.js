// What everything that plays has in common: a button, a slider, keys and a clock.

const REST = 0.8; // seconds on the last step before it starts again

class Transport {
  constructor(root) {
    this.root = root;
    this.data = JSON.parse(this.find("data").textContent);
    Object.assign(this, { step: 0, rest: 0, speed: 1, isPlaying: false, last: null });
    this.scene = this.find("canvas");
    this.prepare();
    this.step = this.data.steps; // it opens at the end, where there is most to see
    this.listen();
    this.fit();
  }

  find(name) {
    return document.getElementById(`${this.root.id}-${name}`);
  }

  listen() {
    this.find("play").addEventListener("click", () => this.toggle());
    this.find("scrub").addEventListener("input", (event) => {
      this.pause();
      this.seek(Number(event.target.value));
    });
    this.root.addEventListener("change", (event) => this.choose(event.target));
    this.root.addEventListener("keydown", (event) => this.press(event));
    new ResizeObserver(() => this.fit()).observe(this.root);
    const theme = window.matchMedia("(prefers-color-scheme: dark)");
    theme.addEventListener("change", () => this.draw());
  }

  choose(input) {
    if (input.name.endsWith("-speed")) this.speed = Number(input.value);
  }

  press(event) {
    const moves = { ArrowLeft: -1, ArrowRight: 1, Home: -Infinity, End: Infinity };
    // Buttons, sliders and boxes keep the keys that they already understand.
    const isOwn = event.target.tagName === "CANVAS" || event.target.id.endsWith("-play");
    if (event.key === " " && event.target.tagName === "CANVAS") this.toggle();
    else if (event.key in moves && isOwn) this.nudge(moves[event.key], event.shiftKey);
    else return;
    event.preventDefault();
  }

  nudge(steps, isFast) {
    this.pause();
    this.seek(Math.round(this.step) + steps * (isFast ? 10 : 1));
  }

  toggle() {
    if (this.isPlaying) this.pause();
    else this.play();
  }

  play() {
    if (this.step >= this.data.steps) this.step = 0;
    Object.assign(this, { isPlaying: true, last: null, rest: 0 });
    this.showState();
    requestAnimationFrame((now) => this.tick(now));
  }

  pause() {
    this.isPlaying = false;
    this.showState();
  }

  showState() {
    const button = this.find("play");
    button.setAttribute("aria-pressed", String(this.isPlaying));
    button.setAttribute("aria-label", this.isPlaying ? "Pause" : "Play");
  }

  tick(now) {
    if (!this.isPlaying) return;
    const seconds = this.last === null ? 0 : Math.min((now - this.last) / 1000, 0.1);
    this.last = now;
    this.advance(seconds);
    requestAnimationFrame((next) => this.tick(next));
  }

  advance(seconds) {
    if (this.step < this.data.steps) {
      this.seek(this.step + (seconds * this.speed) / this.data.timeStep);
      return;
    }
    this.rest += seconds;
    if (this.rest < REST) return;
    this.rest = 0;
    this.seek(0);
  }

  seek(step) {
    this.step = Math.min(Math.max(step, 0), this.data.steps);
    this.draw();
  }

  writeTime(time) {
    this.find("time").textContent = time;
    const scrub = this.find("scrub");
    scrub.value = String(Math.round(this.step));
    scrub.setAttribute("aria-valuetext", time);
    scrub.style.setProperty("--done", `${(100 * this.step) / this.data.steps}%`);
  }
}

// Starts when it first becomes visible, unless the reader prefers reduced motion.
function playWhenSeen(player) {
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) return;
  const observer = new IntersectionObserver((entries) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    observer.disconnect();
    player.play();
  }, { threshold: 0.6 });
  observer.observe(player.scene);
}
