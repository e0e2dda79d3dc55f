// Where things are at a time, and which part of the plane a canvas shows.
// Lengths are millimetres, angles radians, time is counted in steps.

const lerp = (low, high, share) => low + (high - low) * share;

// The value of a list of numbers (null: not observed) between two steps.
function between(values, step) {
  const index = Math.min(Math.floor(step), values.length - 1);
  if (index === step) return values[index] ?? NaN;
  const next = Math.min(index + 1, values.length - 1);
  if (values[index] === null || values[next] === null) return NaN;
  return lerp(values[index], values[next], step - index);
}

function poseAt(track, body, step) {
  const { x, y, angle } = track.bodies[body];
  return { x: between(x, step), y: between(y, step), angle: between(angle, step) };
}

// A prediction moved away from the truth, so that small differences are visible.
function exaggerate(truth, pose, factor) {
  if (factor === 1) return pose;
  const stretched = (name) => truth[name] + factor * (pose[name] - truth[name]);
  return { x: stretched("x"), y: stretched("y"), angle: stretched("angle") };
}

function errorAt(truth, pose) {
  return Math.hypot(pose.x - truth.x, pose.y - truth.y);
}

class Bounds {
  constructor() {
    Object.assign(this, { left: Infinity, right: -Infinity });
    Object.assign(this, { bottom: Infinity, top: -Infinity });
  }

  add(x, y, margin = 0) {
    if (!Number.isFinite(x) || !Number.isFinite(y)) return; // null is no number either
    this.left = Math.min(this.left, x - margin);
    this.right = Math.max(this.right, x + margin);
    this.bottom = Math.min(this.bottom, y - margin);
    this.top = Math.max(this.top, y + margin);
  }
}

// Maps the plane (y up) to a canvas (y down), the whole of the bounds in the middle of
// what is above a footer (pixels).
class View {
  constructor(canvas, bounds, padding, footer = 0) {
    const wide = canvas.clientWidth - 2 * padding;
    const tall = canvas.clientHeight - 2 * padding - footer;
    const [width, height] = [bounds.right - bounds.left, bounds.top - bounds.bottom];
    this.scale = Math.min(wide / width, tall / height);
    this.middle = [(bounds.left + bounds.right) / 2, (bounds.top + bounds.bottom) / 2];
    this.center = [canvas.clientWidth / 2, (canvas.clientHeight - footer) / 2];
  }

  at(x, y) {
    return [
      this.center[0] + this.scale * (x - this.middle[0]),
      this.center[1] - this.scale * (y - this.middle[1]),
    ];
  }
}

// The smallest of 1, 2, 5, 10, ... (times a power of ten) that is at least so much.
function roundUp(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return power * [1, 2, 5, 10].find((digit) => digit * power >= least * 0.999);
}
