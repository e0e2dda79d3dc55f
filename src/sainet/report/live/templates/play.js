// The live page: sends what the user does, shows what the server answers.

import { contactAngleAt, clamp, freePlace, onTable, wrap } from "./geometry.js";
import { Readout, Sliders, byId, choose, chosen } from "./panel.js";
import { Table } from "./table.js";

const FRAME = 1000 / 30; // ms between the poses of an executed push
const SHOWN_FRAMES = 14; // then all bodies rest
const STILL = 5; // pixels: a press that moves less is a push, not a drag
const RETRY = 1000; // ms
const KEPT = 200; // latencies

class Play {
  constructor() {
    this.models = JSON.parse(byId("models").textContent);
    this.table = new Table(byId("table"), this.models);
    this.readout = new Readout(this.models);
    this.sliders = new Sliders((values) => this.change("properties", values));
    this.aim = { contact: 0, direction: 0 };
    this.number = 0;
    this.waiting = null; // the aim that the server works on
    this.next = null; // time of the newest pointer event that has no answer
    this.latencies = [];
    this.isBusy = false; // a push is planned or executed
    this.isChanging = false; // another world or model is on its way
    this.isContinuing = false;
    this.status = { is_ready: false, can_predict: false };
    this.listen();
    this.connect();
  }

  // The connection.

  connect() {
    this.socket = new WebSocket(`ws://${window.location.host}/live`);
    this.socket.addEventListener("message", (event) => this.receive(JSON.parse(event.data)));
    this.socket.addEventListener("open", () => {
      Object.assign(this, { waiting: null, next: null, isBusy: false, isChanging: false });
    });
    this.socket.addEventListener("close", (event) => this.lose(event.code));
  }

  lose(code) {
    this.setContinuing(false);
    this.setStatus({ text: "Connection lost; trying again …", is_ready: false, can_predict: false });
    if (code === 1009) this.notify("The last message was too long.", true);
    window.setTimeout(() => this.connect(), RETRY);
  }

  send(type, values = {}) {
    if (this.socket.readyState !== WebSocket.OPEN) return;
    this.socket.send(JSON.stringify({ type, ...values }));
  }

  receive(answer) {
    const take = {
      status: () => this.setStatus(answer),
      view: () => this.setView(answer),
      ghosts: () => this.setGhosts(answer),
      moved: () => this.animate(answer),
      notice: () => this.fail(answer),
    }[answer.type];
    if (take) take();
  }

  // Answers.

  setStatus(status) {
    this.status = status;
    byId("status").textContent = status.text;
    document.body.dataset.ready = String(status.is_ready);
    this.enable();
    if (status.can_predict) this.predict(performance.now());
  }

  setView(view) {
    const held = this.drag?.hasMoved ? this.drag.held : null;
    // What is being dragged is where the pointer is.
    if (held === "goal") view.goal_mm = this.view.goal_mm;
    else if (view.disks[held]) view.disks[held].pose = this.view.disks[held].pose;
    this.view = view;
    this.isChanging = false;
    this.table.show(view);
    this.sliders.show(view);
    ["world", "noise", "model"].forEach((name) => choose(name, view[name]));
    choose("disks", view.disks.length);
    document.querySelectorAll('input[name="disks"], input[name="noise"]').forEach((input) => {
      input.disabled = view.world === "lab" && !input.checked;
    });
    this.table.hidePlan();
    this.describe();
    this.enable();
    this.predict(performance.now());
  }

  describe() {
    const { target, distance_mm: distance, is_solved: isSolved, pushes, tolerance_mm: tolerance } = this.view;
    const count = `${pushes} push${pushes === 1 ? "" : "es"}`;
    const away = distance === null ? "nowhere" : `${distance.toFixed(1)} mm from its goal`;
    byId("outcome").textContent = isSolved
      ? `Disk ${target + 1} is at its goal after ${count}.`
      : `After ${count}, disk ${target + 1} is ${away} (tolerance ${tolerance.toFixed(1)} mm).`;
  }

  setGhosts(ghosts) {
    if (ghosts.number !== this.waiting?.number) return;
    const { since } = this.waiting;
    this.waiting = null;
    if (!this.isBusy && !this.isHolding) {
      this.table.showAim(this.aim);
      byId("pusher").classList.toggle("blocked", ghosts.blocked !== "");
      this.isBlocked = ghosts.blocked !== "";
      if (this.isBlocked) {
        this.table.hideGhosts();
        this.readout.clear(ghosts.blocked);
      } else {
        this.table.showGhosts(ghosts);
        this.readout.show(ghosts);
      }
      this.measure(performance.now() - since);
      this.enable();
    }
    if (this.next !== null) this.predict(this.next);
  }

  measure(latency) {
    this.latencies = [...this.latencies.slice(1 - KEPT), latency];
    const median = [...this.latencies].sort((a, b) => a - b)[Math.floor(this.latencies.length / 2)];
    const output = byId("latency");
    output.textContent = `Predicted in ${Math.max(1, Math.round(latency))} ms`;
    output.dataset.median = median.toFixed(2);
    output.dataset.count = this.latencies.length;
  }

  async animate({ step, ghosts, view }) {
    this.isBusy = true;
    this.enable();
    this.table.hideGhosts();
    const model = this.models.find(({ name }) => name === view.model);
    this.table.showPlan(step, model.id);
    const isStill = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    const frames = isStill ? 0 : Math.min(SHOWN_FRAMES, step.actual.length);
    const start = performance.now();
    for (let frame = 0; frame < frames;) {
      step.actual[frame].forEach((pose, index) => this.table.placeDisk(index, pose));
      if (step.pusher[frame].every((part) => part !== null)) this.table.placePusher(step.pusher[frame]);
      await new Promise((resolve) => { requestAnimationFrame(resolve); });
      frame = Math.floor((performance.now() - start) / FRAME);
    }
    this.view = view;
    this.table.show(view);
    this.table.addTrail(step);
    this.table.showGhosts(ghosts);
    this.readout.show(ghosts);
    this.describe();
    Object.assign(this, { isBusy: false, isHolding: true, moved: [0, 0] });
    if (step.trouble) this.notify(`${step.trouble.charAt(0).toUpperCase()}${step.trouble.slice(1)}.`, true);
    this.enable();
    if (this.isContinuing) this.goOn();
  }

  goOn() {
    if (this.view.is_solved) this.setContinuing(false);
    else this.plan();
  }

  fail({ text, is_error: isError }) {
    Object.assign(this, { isBusy: false, isChanging: false });
    this.setContinuing(false);
    this.notify(text, isError);
  }

  notify(text, isError) {
    const notice = byId("notice");
    notice.hidden = text === "";
    notice.classList.toggle("error", isError);
    byId("notice-text").textContent = text;
  }

  // What the user does.

  predict(since) {
    if (!this.view || !this.status.can_predict || this.isBusy || this.isHolding) return;
    this.next = since;
    if (this.waiting !== null) return;
    this.number += 1;
    this.waiting = { number: this.number, since };
    this.next = null;
    this.send("aim", { number: this.number, ...this.wanted() });
  }

  wanted() {
    const { contact, direction } = this.aim;
    return { contact_angle_deg: Number(contact.toFixed(3)), direction_deg: direction };
  }

  setAim(contact, direction, since = performance.now()) {
    this.isHolding = false;
    this.aim = { contact: wrap(contact), direction: clamp(direction, -30, 30) };
    byId("direction").value = this.aim.direction;
    byId("direction-text").textContent = `${this.aim.direction.toFixed(0)}°`;
    if (this.view && !this.isBusy) this.table.showAim(this.aim);
    this.predict(since);
  }

  push() {
    if (!this.canPush) return;
    this.begin();
    this.send("push", this.wanted());
  }

  plan() {
    if (!this.isFree) return;
    this.begin();
    this.send("plan");
  }

  begin() {
    this.notify("", false);
    this.isBusy = true;
    this.enable();
  }

  setContinuing(isContinuing) {
    this.isContinuing = isContinuing;
    byId("continue").textContent = isContinuing ? "Stop" : "Continue to the goal";
    byId("continue").setAttribute("aria-pressed", String(isContinuing));
    this.enable();
  }

  get isFree() {
    return this.status.is_ready && !this.isBusy && !this.isChanging && Boolean(this.view);
  }

  get canPush() {
    return this.isFree && !this.isBlocked;
  }

  enable() {
    const { isFree } = this;
    byId("push").disabled = !this.canPush;
    byId("plan").disabled = !isFree || this.isContinuing;
    byId("continue").disabled = !(this.isContinuing || (isFree && !this.view.is_solved));
    byId("restart").disabled = !isFree || this.isContinuing;
    byId("save").disabled = !isFree || this.isContinuing || this.view.episodes === 0;
    ["world-choices", "model-choices"].forEach((id) => { byId(id).disabled = !isFree || this.isContinuing; });
    byId("properties").disabled = !isFree || this.isContinuing || !this.view.has_own_properties;
  }

  listen() {
    byId("push").addEventListener("click", () => this.push());
    byId("plan").addEventListener("click", () => this.plan());
    byId("continue").addEventListener("click", () => {
      this.setContinuing(!this.isContinuing);
      if (this.isContinuing) this.plan();
    });
    byId("restart").addEventListener("click", () => this.change("restart"));
    byId("save").addEventListener("click", () => this.send("save"));
    byId("close-notice").addEventListener("click", () => this.notify("", false));
    byId("direction").addEventListener("input", (event) => this.setAim(this.aim.contact, Number(event.target.value)));
    byId("zoom").addEventListener("change", () => this.table.setFactor(Number(chosen("zoom"))));
    byId("model-choices").addEventListener("change", () => this.change("model", { model: chosen("model") }));
    byId("world-choices").addEventListener("change", () => this.chooseWorld());
    this.listenToPointer();
    this.table.root.addEventListener("keydown", (event) => this.press(event));
  }

  change(type, values) {
    this.notify("", false);
    Object.assign(this, { isHolding: false, isChanging: true });
    this.enable();
    this.send(type, values);
  }

  chooseWorld() {
    const world = chosen("world");
    const disks = world === "lab" ? 2 : Number(chosen("disks"));
    this.change("world", { world, disks, noise: chosen("noise") });
  }

  listenToPointer() {
    const { root } = this.table;
    root.addEventListener("pointerdown", (event) => this.take(event));
    root.addEventListener("pointermove", (event) => this.follow(event));
    root.addEventListener("pointerup", (event) => this.release(event));
    root.addEventListener("pointercancel", () => { this.drag = null; });
  }

  take(event) {
    if (event.button !== 0 || !this.view || this.isBusy || this.isContinuing) return;
    const place = this.table.placeOf(event);
    const element = event.target.closest(".disk, #goal");
    const held = element?.id === "goal" ? "goal" : element ? Number(element.id.split("-")[1]) - 1 : null;
    const centre = held === "goal" ? this.view.goal_mm : held === null ? place : this.view.disks[held].pose;
    const offset = [centre[0] - place[0], centre[1] - place[1]];
    this.drag = { held, offset, from: [event.clientX, event.clientY], hasMoved: false };
    if (held !== null) this.table.root.setPointerCapture(event.pointerId);
    if (event.pointerType !== "mouse" && held === null) this.aimAt(event);
  }

  follow(event) {
    const pressed = this.drag;
    if (pressed) {
      const way = Math.hypot(event.clientX - pressed.from[0], event.clientY - pressed.from[1]);
      pressed.hasMoved ||= way > STILL;
      if (pressed.held === null) {
        if (event.pointerType !== "mouse") this.aimAt(event);
      } else if (pressed.hasMoved) this.pull(event, pressed);
      return;
    }
    if (event.pointerType !== "mouse") return;
    if (this.isHolding) {
      // The errors of a push stay until the pointer clearly moves on.
      this.moved = [this.moved[0] + event.movementX, this.moved[1] + event.movementY];
      if (Math.hypot(...this.moved) < 3 * STILL) return;
    }
    this.aimAt(event);
  }

  aimAt(event) {
    if (!this.view || this.isBusy || this.isContinuing) return;
    const contact = contactAngleAt(this.view, this.table.placeOf(event));
    if (contact !== null) this.setAim(contact, this.aim.direction, event.timeStamp);
  }

  pull(event, { held, offset }) {
    const place = this.table.placeOf(event).map((part, axis) => part + offset[axis]);
    this.put(held, place, event.timeStamp, false);
  }

  // Shows a disk or the goal on a place, and sends the place.
  put(held, wanted, since, isLast) {
    this.isHolding = false;
    if (held === "goal") {
      const [x, y] = onTable(this.view, wanted);
      this.view.goal_mm = [x, y];
      this.table.placeGoal([x, y]);
      this.send("goal", rounded([x, y]));
      return;
    }
    const disk = this.view.disks[held];
    const [x, y] = freePlace(this.view, held, wanted);
    disk.pose = [x, y, disk.pose[2]];
    this.table.placeDisk(held, disk.pose);
    this.table.showAim(this.aim);
    // In the lab a person puts the disks, not exactly: once is enough.
    if (this.view.world === "lab" && !isLast) return;
    this.send("disk", { disk: held + 1, ...rounded([x, y]) });
    this.predict(since);
  }

  release(event) {
    const pressed = this.drag;
    this.drag = null;
    if (!pressed) return;
    if (pressed.held !== null && pressed.hasMoved) {
      const place = pressed.held === "goal" ? this.view.goal_mm : this.view.disks[pressed.held].pose;
      this.put(pressed.held, place.slice(0, 2), event.timeStamp, true);
    } else if (!pressed.hasMoved && event.pointerType === "mouse") this.push();
  }

  press(event) {
    const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const element = event.target.closest(".disk, #goal, #pusher");
    if (!element || !this.view || this.isBusy || this.isContinuing) return;
    if (event.key === "Enter" || event.key === " ") this.push();
    else if (event.key in moves) this.nudge(element, moves[event.key], event.shiftKey ? 1 : 5);
    else return;
    event.preventDefault();
  }

  nudge(element, [x, y], size) {
    if (element.id === "pusher") {
      this.setAim(this.aim.contact + x * size, this.aim.direction + y * size);
      return;
    }
    const held = element.id === "goal" ? "goal" : Number(element.id.split("-")[1]) - 1;
    const place = held === "goal" ? this.view.goal_mm : this.view.disks[held].pose;
    this.put(held, [place[0] + x * size, place[1] + y * size], performance.now(), true);
  }
}

function rounded([x, y]) {
  return { x_mm: Number(x.toFixed(3)), y_mm: Number(y.toFixed(3)) };
}

new Play();
