// Plays the pushes of the page: one Player for each element with data-replay.

const REST = 0.8; // seconds on the last step before it starts again
const LENS_PADDING = 22; // pixels
const SCENE_PADDING = 14; // pixels
const SCENE_FOOTER = 26; // pixels, for the scale

class Player {
  constructor(root) {
    this.root = root;
    this.data = JSON.parse(this.find("data").textContent);
    this.truth = this.data.tracks[0];
    this.shown = new Set(this.data.tracks.keys());
    Object.assign(this, { step: 0, rest: 0, speed: 0.1, factor: 1 });
    Object.assign(this, { isPlaying: false, last: null });
    this.scene = this.find("canvas");
    this.lenses = [...root.querySelectorAll("[data-view=lens]")];
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
    if (input.name.endsWith("-zoom")) this.factor = Number(input.value);
    if (input.dataset.show) {
      const model = Number(input.dataset.show);
      if (input.checked) this.shown.add(model);
      else this.shown.delete(model);
    }
    this.fit();
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

  poseOf(track, body, step) {
    const pose = poseAt(track, body, step);
    return exaggerate(poseAt(this.truth, body, step), pose, this.factor);
  }

  // Chooses what part of the plane each canvas shows: all that it will ever show.
  fit() {
    const tracks = this.data.tracks.filter((track) => this.isShown(track));
    this.sceneView = new View(
      this.scene, this.sceneBounds(tracks), SCENE_PADDING, SCENE_FOOTER,
    );
    this.lensViews = this.lenses.map((canvas, body) => {
      return new View(canvas, this.lensBounds(tracks, body), LENS_PADDING);
    });
    this.spacings = this.lensViews.map((view) => roundUp(20 / view.scale));
    this.spacings.forEach((spacing, body) => {
      const note = this.root.querySelector(`[data-grid="${body}"]`);
      note.textContent = `${Number(spacing.toPrecision(1))} mm grid`;
    });
    this.draw();
  }

  isShown(track) {
    return this.shown.has(this.data.tracks.indexOf(track));
  }

  sceneBounds(tracks) {
    const bounds = new Bounds();
    const { steps, pusherRadius, pusher } = this.data;
    for (const step of [0, 0.25, 0.5, 0.75, 1].map((share) => share * steps)) {
      bounds.add(between(pusher.x, step), between(pusher.y, step), pusherRadius);
      for (const track of [this.truth, ...tracks]) {
        this.data.radius.forEach((radius, body) => {
          const { x, y } = this.poseOf(track, body, step);
          bounds.add(x, y, radius);
        });
      }
    }
    return bounds;
  }

  lensBounds(tracks, body) {
    const bounds = new Bounds();
    for (const track of [this.truth, ...tracks]) {
      const { x, y } = track.bodies[body];
      x.forEach((value, step) => bounds.add(value ?? NaN, y[step] ?? NaN, 0.25));
    }
    return bounds;
  }

  draw() {
    const style = getComputedStyle(this.root);
    const color = (name) => style.getPropertyValue(name).trim();
    this.ink = color("--ink");
    this.looks = this.data.tracks.map((track) => {
      return { color: color(track.color), dash: track.dash };
    });
    this.drawScene();
    this.lenses.forEach((canvas, body) => this.drawLens(canvas, body));
    this.write();
  }

  drawScene() {
    const context = wipe(this.scene);
    const [view, { pusher, radius }] = [this.sceneView, this.data];
    this.eachShown((track, look) => {
      radius.forEach((size, body) => this.drawBody(context, track, look, body));
    });
    const place = [between(pusher.x, this.step), between(pusher.y, this.step)];
    const size = this.data.pusherRadius * view.scale;
    drawDot(context, view.at(...place), size, this.ink);
    drawScaleBar(context, this.scene, view, this.ink);
  }

  drawBody(context, track, look, body) {
    const [view, radius] = [this.sceneView, this.data.radius[body]];
    const placeAt = (step) => this.poseOf(track, body, step);
    const pose = placeAt(this.step);
    if (!Number.isFinite(pose.x + pose.y)) return;
    if (track === this.truth) drawTrueDisk(context, view, pose, radius, this.ink);
    else drawOutline(context, view, pose, radius, look);
    drawTrail(context, view, placeAt, this.step, look.color, 1.5);
  }

  drawLens(canvas, body) {
    const context = wipe(canvas);
    const view = this.lensViews[body];
    drawGrid(context, canvas, view, this.spacings[body], this.ink);
    this.eachShown((track, look) => {
      const placeAt = (step) => poseAt(track, body, step);
      const { x, y } = placeAt(this.step);
      if (!Number.isFinite(x + y)) return;
      drawTrail(context, view, placeAt, this.step, look.color, 2);
      drawDot(context, view.at(x, y), 4, look.color);
    });
  }

  // The truth comes first in the data, so the predictions lie on top of it.
  eachShown(visit) {
    this.data.tracks.forEach((track, model) => {
      if (this.shown.has(model)) visit(track, this.looks[model]);
    });
  }

  write() {
    const time = `${Math.round(this.step * this.data.timeStep * 1000)} ms`;
    this.find("time").textContent = time;
    const scrub = this.find("scrub");
    scrub.value = String(Math.round(this.step));
    scrub.setAttribute("aria-valuetext", time);
    scrub.style.setProperty("--done", `${(100 * this.step) / this.data.steps}%`);
    this.root.querySelectorAll("[data-model]").forEach((row) => this.writeErrors(row));
  }

  writeErrors(row) {
    const track = this.data.tracks[Number(row.dataset.model)];
    if (track === this.truth) return;
    row.querySelectorAll("[data-error]").forEach((cell) => {
      const body = Number(cell.dataset.error);
      const poses = [this.truth, track].map((each) => poseAt(each, body, this.step));
      const error = errorAt(...poses);
      cell.textContent = Number.isFinite(error) ? `${error.toFixed(2)} mm` : "–";
    });
  }
}

// Starts by itself the first time that it is seen, unless motion is unwelcome.
function playWhenSeen(player) {
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) return;
  const observer = new IntersectionObserver((entries) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    observer.disconnect();
    player.play();
  }, { threshold: 0.6 });
  observer.observe(player.scene);
}

document.querySelectorAll("[data-replay]").forEach((root) => {
  playWhenSeen(new Player(root));
});
