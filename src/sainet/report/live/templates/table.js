// The table as SVG: every disk, ghost and the goal is an element with a stable id.

import { exaggerated, strokeOf } from "./geometry.js";

const SVG = "http://www.w3.org/2000/svg";
const MARGIN = 2; // mm around the table
const GRID = 100; // mm

function make(name, attributes = {}, parent = null) {
  const element = document.createElementNS(SVG, name);
  Object.entries(attributes).forEach(([key, value]) => element.setAttribute(key, value));
  if (parent) parent.append(element);
  return element;
}

function isKnown(pose) {
  return pose.every((value) => value !== null);
}

export class Table {
  constructor(root, models) {
    this.root = root;
    this.models = models;
    this.factor = 5;
    this.ghosts = null;
    this.layers = {};
    ["grid", "trails", "goal", "disks", "plan", "ghosts", "pusher"].forEach((name) => {
      this.layers[name] = make("g", { class: name }, root);
    });
    this.drawGoal();
    this.drawPusher();
  }

  // Shows a view; elements are made anew only if the number of disks changes.
  show(view) {
    const isOther = !this.view || this.view.disks.length !== view.disks.length;
    if (isOther || String(this.view.table_mm) !== String(view.table_mm)) this.drawEdges(view);
    this.view = view;
    if (isOther) this.makeDisks();
    view.disks.forEach((disk, index) => {
      this.sizeDisk(index, disk.radius_mm);
      this.placeDisk(index, disk.pose);
    });
    this.placeGoal(view.goal_mm);
    if (view.pushes === 0) this.layers.trails.replaceChildren();
  }

  drawEdges(view) {
    const [low, high] = view.table_mm;
    const size = [high[0] - low[0], high[1] - low[1]];
    const box = [low[0] - MARGIN, -high[1] - MARGIN, size[0] + 2 * MARGIN, size[1] + 2 * MARGIN];
    this.root.setAttribute("viewBox", box.join(" "));
    this.layers.grid.replaceChildren();
    make("rect", { class: "edge", x: low[0], y: -high[1], width: size[0], height: size[1], rx: 10 }, this.layers.grid);
    for (let x = Math.ceil(low[0] / GRID) * GRID; x < high[0]; x += GRID) {
      if (x > low[0]) make("line", { x1: x, x2: x, y1: -high[1], y2: -low[1] }, this.layers.grid);
    }
    for (let y = Math.ceil(low[1] / GRID) * GRID; y < high[1]; y += GRID) {
      make("line", { x1: low[0], x2: high[0], y1: -y, y2: -y }, this.layers.grid);
    }
    const bar = [high[0] - 24 - GRID, -low[1] - 20];
    make("path", { class: "scale", d: `M${bar[0]} ${bar[1]}h${GRID}` }, this.layers.grid);
    make("text", { x: bar[0] + GRID / 2, y: bar[1] - 7 }, this.layers.grid).textContent = "100 mm";
  }

  makeDisks() {
    const { disks, ghosts } = this.layers;
    disks.replaceChildren();
    ghosts.replaceChildren();
    this.view.disks.forEach((disk, index) => {
      const role = index === 0 ? "pushed" : index === this.view.target ? "moved" : "other";
      const group = make("g", {
        id: `disk-${index + 1}`, class: `disk ${role}`, tabindex: 0, role: "button",
        "aria-roledescription": "disk that can be dragged", "aria-describedby": "keys",
      }, disks);
      make("circle", { class: "body", r: disk.radius_mm }, group);
      make("line", { class: "mark" }, group);
      make("text", { class: "number", dy: "0.35em" }, group).textContent = String(index + 1);
    });
    this.models.forEach((model) => {
      this.view.disks.forEach((disk, index) => {
        const group = make("g", {
          id: `ghost-${model.id}-${index + 1}`, class: "ghost", visibility: "hidden",
        }, ghosts);
        group.classList.add(`model-${model.id}`);
        make("circle", { class: "body", r: disk.radius_mm }, group);
        make("line", { class: "mark" }, group);
        make("circle", { class: "centre", r: 1.6 }, group);
      });
    });
  }

  sizeDisk(index, radius) {
    const groups = [this.disk(index), ...this.models.map((model) => this.ghost(model.id, index))];
    groups.forEach((group) => {
      group.querySelector(".body").setAttribute("r", radius);
      const mark = group.querySelector(".mark");
      mark.setAttribute("x1", 0.74 * radius);
      mark.setAttribute("x2", radius);
    });
  }

  disk(index) {
    return document.getElementById(`disk-${index + 1}`);
  }

  ghost(model, index) {
    return document.getElementById(`ghost-${model}-${index + 1}`);
  }

  placeDisk(index, pose) {
    const group = this.disk(index);
    if (!isKnown(pose)) return;
    group.setAttribute("transform", `translate(${pose[0]} ${-pose[1]}) rotate(${-pose[2]})`);
    // The number stays upright.
    group.querySelector(".number").setAttribute("transform", `rotate(${pose[2]})`);
    const place = `x ${pose[0].toFixed(0)} mm, y ${pose[1].toFixed(0)} mm`;
    const task = index === 0 ? ", the robot pushes it" : index === this.view.target ? ", it has the goal" : "";
    group.setAttribute("aria-label", `Disk ${index + 1}${task}; ${place}`);
  }

  drawGoal() {
    const goal = make("g", {
      id: "goal", tabindex: 0, role: "button",
      "aria-roledescription": "goal that can be dragged", "aria-describedby": "keys",
    }, this.layers.goal);
    make("circle", { class: "reach" }, goal);
    make("circle", { class: "tolerance" }, goal);
    make("path", { class: "cross", d: "M-3 0h6M0 -3v6" }, goal);
    this.goal = goal;
  }

  placeGoal([x, y]) {
    const target = this.view.disks[this.view.target];
    this.goal.setAttribute("transform", `translate(${x} ${-y})`);
    this.goal.querySelector(".reach").setAttribute("r", target.radius_mm);
    this.goal.querySelector(".tolerance").setAttribute("r", this.view.tolerance_mm);
    this.goal.classList.toggle("reached", this.view.is_solved);
    this.goal.setAttribute("aria-label", `Goal of disk ${this.view.target + 1}; x ${x.toFixed(0)} mm, y ${y.toFixed(0)} mm`);
  }

  drawPusher() {
    const group = make("g", {
      id: "pusher", tabindex: 0, role: "button", "aria-label": "Pusher",
      "aria-describedby": "pusher-keys", visibility: "hidden",
    }, this.layers.pusher);
    make("path", { class: "stroke" }, group);
    make("circle", { class: "reach", r: 16 }, group);
    make("circle", { class: "tip" }, group);
    this.pusher = group;
  }

  showAim(aim) {
    const { start, heading, length } = strokeOf(this.view, aim);
    this.placePusher(start);
    const radius = this.view.pusher_radius_mm;
    const back = 34;
    // A stem behind the pusher shows where it comes from.
    const from = heading.map((part) => -part * (radius + back));
    const to = heading.map((part) => -part * (radius + 3));
    const stroke = this.pusher.querySelector(".stroke");
    const side = [-heading[1] * 4, heading[0] * 4];
    const neck = heading.map((part) => -part * (radius + 10));
    const points = [from, to, neck.map((part, axis) => part + side[axis]), to, neck.map((part, axis) => part - side[axis])];
    stroke.setAttribute("d", `M${points.map(([x, y]) => `${x.toFixed(2)} ${(-y).toFixed(2)}`).join("L")}`);
    stroke.setAttribute("visibility", "inherit");
    this.pusher.setAttribute("aria-label", `Pusher: contact angle ${aim.contact.toFixed(0)}, push direction ${aim.direction.toFixed(0)} degrees, stroke ${length} mm`);
  }

  placePusher([x, y]) {
    this.pusher.setAttribute("visibility", "visible");
    this.pusher.setAttribute("transform", `translate(${x} ${-y})`);
    this.pusher.querySelector(".tip").setAttribute("r", this.view.pusher_radius_mm);
    this.pusher.querySelector(".stroke").setAttribute("visibility", "hidden");
  }

  setFactor(factor) {
    this.factor = factor;
    if (this.ghosts) this.showGhosts(this.ghosts);
  }

  showGhosts(ghosts) {
    this.hideGhosts();
    this.ghosts = ghosts;
    ghosts.ghosts.forEach(({ model, pose }) => {
      const id = this.models.find((each) => each.name === model).id;
      pose.forEach((each, index) => {
        const group = this.ghost(id, index);
        if (!group || !isKnown(each) || !isKnown(ghosts.reference[index])) return;
        const [x, y, angle] = exaggerated(each, ghosts.reference[index], this.factor);
        group.setAttribute("transform", `translate(${x} ${-y}) rotate(${-angle})`);
        group.setAttribute("visibility", "visible");
      });
    });
  }

  hideGhosts() {
    this.ghosts = null;
    this.layers.ghosts.querySelectorAll(".ghost").forEach((each) => each.setAttribute("visibility", "hidden"));
  }

  showPlan(step, model) {
    this.layers.plan.replaceChildren();
    if (step.planned_pushes < 1 || step.evaluated === 0) return;
    step.observed.forEach((pose, index) => {
      const line = this.line([pose, ...step.planned.map((poses) => poses[index])], this.layers.plan);
      line.setAttribute("class", `planned model-${model}`);
    });
  }

  hidePlan() {
    this.layers.plan.replaceChildren();
  }

  addTrail(step) {
    step.observed.forEach((pose, index) => {
      const line = this.line([pose, ...step.actual.map((poses) => poses[index])], this.layers.trails);
      line.setAttribute("class", `trail ${this.disk(index).getAttribute("class")}`);
    });
  }

  line(poses, parent) {
    const points = poses.filter(isKnown).map(([x, y]) => `${x},${-y}`).join(" ");
    return make("polyline", { points }, parent);
  }

  // The place of a pointer on the table, in mm.
  placeOf(event) {
    const matrix = this.root.getScreenCTM().inverse();
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix);
    return [point.x, -point.y];
  }
}
