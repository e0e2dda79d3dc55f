// Plays whole episodes: one for each element with data-episode.

const PLAN_FADES = 0.45; // what a plan keeps of its strength with each newer one
const PLANS_SHOWN = 4;
const CHART = { left: 34, right: 10, top: 12, bottom: 22 }; // pixels

class Episode extends Transport {
  prepare() {
    this.chart = this.find("chart");
  }

  fit() {
    const bounds = new Bounds();
    const { bodies, radius, goal, pusher, pusherRadius } = this.data;
    bodies.forEach(({ x, y }, body) => {
      x.forEach((value, frame) => bounds.add(value, y[frame], radius[body]));
    });
    pusher.x.forEach((value, frame) => bounds.add(value, pusher.y[frame], pusherRadius));
    bounds.add(goal.x, goal.y, this.data.tolerance);
    this.view = new View(this.scene, bounds, 14, 26);
    this.draw();
  }

  // The decision that is being carried out: the last one that has begun.
  turn() {
    const { turns } = this.data;
    const next = turns.findIndex((turn) => turn.start > this.step);
    return (next < 0 ? turns.length : next) - 1;
  }

  draw() {
    const style = getComputedStyle(this.root);
    const color = (name) => style.getPropertyValue(name).trim();
    this.ink = color("--ink");
    this.target = color("--target");
    this.colors = this.data.bodies.map((_, body) => {
      if (body === this.data.moved) return color("--moved");
      return body === 0 ? color("--pushed") : color("--other");
    });
    this.drawScene();
    this.drawChart();
    this.write();
  }

  drawScene() {
    const context = wipe(this.scene);
    const { goal, tolerance, bodies, pusher, pusherRadius } = this.data;
    drawDot(context, this.view.at(goal.x, goal.y), tolerance * this.view.scale, this.target);
    bodies.forEach((_, body) => this.drawGhost(context, body));
    bodies.forEach((_, body) => this.drawBody(context, body));
    this.drawPlans(context);
    const place = [between(pusher.x, this.step), between(pusher.y, this.step)];
    drawDot(context, this.view.at(...place), pusherRadius * this.view.scale, this.ink);
    this.drawTolerance(context);
    drawScaleBar(context, this.scene, this.view, this.ink);
  }

  // The circle that the centre must come into; it thickens at the moment of success.
  drawTolerance(context) {
    const { goal, tolerance, moved, solved, steps } = this.data;
    const isReached = solved && this.step >= steps;
    strokeWith(context, isReached ? this.colors[moved] : this.ink, isReached ? 3 : 1);
    circle(context, this.view.at(goal.x, goal.y), tolerance * this.view.scale);
    context.stroke();
  }

  // Where a disk stood at the beginning.
  drawGhost(context, body) {
    const { x, y } = poseAt(this.data, body, 0);
    context.globalAlpha = 0.35;
    strokeWith(context, this.colors[body], 1, [3, 3]);
    circle(context, this.view.at(x, y), this.data.radius[body] * this.view.scale);
    context.stroke();
    context.globalAlpha = 1;
  }

  drawBody(context, body) {
    const [pose, radius] = [poseAt(this.data, body, this.step), this.data.radius[body]];
    const color = this.colors[body];
    circle(context, this.view.at(pose.x, pose.y), radius * this.view.scale);
    tint(context, color, 0.3);
    strokeWith(context, color, 1.5);
    context.stroke();
    drawMark(context, this.view, pose, radius, 0.8);
    const placeAt = (step) => poseAt(this.data, body, step);
    if (this.step > 0) drawTrail(context, this.view, placeAt, this.step, { color }, 1.5);
    drawDot(context, this.view.at(pose.x, pose.y), 2.5, color);
  }

  // The planned ways, each fainter the more decisions have replaced it.
  drawPlans(context) {
    const now = this.turn();
    for (let turn = Math.max(now - PLANS_SHOWN + 1, 0); turn <= now; turn += 1) {
      context.globalAlpha = PLAN_FADES ** (now - turn);
      this.data.turns[turn].plan.forEach(({ x, y }) => {
        strokeWith(context, this.ink, 1.25, [2, 2]);
        context.beginPath();
        x.forEach((value, index) => context.lineTo(...this.view.at(value, y[index])));
        context.stroke();
        const last = x.length - 1;
        drawDot(context, this.view.at(x[last], y[last]), 2, this.ink);
      });
    }
    context.globalAlpha = 1;
  }

  drawChart() {
    const context = wipe(this.chart);
    const { distances, tolerance } = this.data;
    const high = roundUp(Math.max(...distances, tolerance));
    const [wide, tall] = [this.chart.clientWidth, this.chart.clientHeight];
    const last = Math.max(distances.length - 1, 1);
    const at = (push, distance) => [
      CHART.left + ((wide - CHART.left - CHART.right) * push) / last,
      tall - CHART.bottom - ((tall - CHART.top - CHART.bottom) * distance) / high,
    ];
    this.drawAxes(context, at, last, high);
    context.fillStyle = this.target;
    context.globalAlpha = 0.5;
    const [corner, origin] = [at(last, tolerance), at(0, 0)];
    context.fillRect(origin[0], corner[1], corner[0] - origin[0], origin[1] - corner[1]);
    context.globalAlpha = 1;
    strokeWith(context, this.colors[this.data.moved], 2);
    context.beginPath();
    const seen = this.observations();
    const curve = distances.slice(0, seen).map((value, push) => at(push, value ?? NaN));
    curve.forEach((place) => context.lineTo(...place));
    context.stroke();
    const place = curve[seen - 1];
    drawDot(context, place, 4, this.colors[this.data.moved]);
    if (!this.data.solved || this.step < this.data.steps) return;
    strokeWith(context, this.ink, 1.5);
    circle(context, place, 7);
    context.stroke();
  }

  drawAxes(context, at, last, high) {
    context.fillStyle = this.ink;
    context.font = "11px system-ui, sans-serif";
    context.globalAlpha = 0.75;
    context.textAlign = "right";
    [0, high / 2, high].forEach((value) => {
      const [x, y] = at(0, value);
      context.fillText(String(value), x - 5, y + 4);
    });
    context.textAlign = "center";
    [0, last].forEach((push) => {
      const [x, y] = at(push, 0);
      context.fillText(String(push), x, y + 15);
    });
    context.globalAlpha = 0.3;
    strokeWith(context, this.ink, 1);
    drawLine(context, at(0, 0), at(last, 0));
    context.globalAlpha = 1;
  }

  // How many observations have been made: one before each push, one at the end.
  observations() {
    const isOver = this.step >= this.data.steps;
    return isOver ? this.data.distances.length : Math.max(this.turn(), 0) + 1;
  }

  write() {
    const seconds = this.step * this.data.timeStep;
    this.writeTime(`${seconds.toFixed(1)} s`);
    const [seen, { turns, distances, moved, said }] = [this.observations(), this.data];
    const away = distances[seen - 1]; // null where the world left the finite numbers
    const where = away === null ? "nowhere" : `${away.toFixed(1)} mm from its goal`;
    const distance = `disk ${moved + 1} is ${where}`;
    const isOver = this.step >= this.data.steps;
    const push = `push ${this.turn() + 1} of ${turns.length}`;
    this.find("status").textContent = isOver ? `${said}: ${distance}` : `${push}: ${distance}`;
  }
}

document.querySelectorAll("[data-episode]").forEach((root) => {
  playWhenSeen(new Episode(root));
});
