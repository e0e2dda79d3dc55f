// Plays the pushes of the page: one Player for each element with data-replay.

const LENS_PADDING = 22; // pixels
const SCENE_PADDING = 14; // pixels
const SCENE_FOOTER = 26; // pixels, for the scale

class Player extends Transport {
  prepare() {
    this.truth = this.data.tracks[0];
    this.shown = new Set(this.data.tracks.keys());
    Object.assign(this, { speed: this.data.speed, factor: 5 });
    this.lenses = [...this.root.querySelectorAll("[data-view=lens]")];
  }

  choose(input) {
    super.choose(input);
    if (input.name.endsWith("-zoom")) this.factor = Number(input.value);
    if (input.dataset.show) {
      const model = Number(input.dataset.show);
      if (input.checked) this.shown.add(model);
      else this.shown.delete(model);
    }
    this.fit();
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
      if (track.region) {
        bounds.add(x.at(-1), y.at(-1), Math.max(...track.region.axes[body]));
      }
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
    drawTrail(context, view, placeAt, this.step, look, 1.5);
  }

  drawLens(canvas, body) {
    const context = wipe(canvas);
    const view = this.lensViews[body];
    drawGrid(context, canvas, view, this.spacings[body], this.ink);
    this.eachShown((track, look) => {
      const placeAt = (step) => poseAt(track, body, step);
      if (track.region) {
        const { heading, axes } = track.region;
        drawEllipse(context, view, placeAt(this.data.steps), axes[body], heading, look.color);
      }
      const { x, y } = placeAt(this.step);
      if (!Number.isFinite(x + y)) return;
      drawTrail(context, view, placeAt, this.step, look, 2);
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
    this.writeTime(`${Math.round(this.step * this.data.timeStep * 1000)} ms`);
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

document.querySelectorAll("[data-replay]").forEach((root) => {
  playWhenSeen(new Player(root));
});
