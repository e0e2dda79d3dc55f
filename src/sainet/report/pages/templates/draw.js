// Drawing on a canvas; each function is given everything that it draws.

const TRAIL_PIECES = 40;

// Returns a context scaled to the screen's pixels, the canvas wiped.
function wipe(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const size = [canvas.clientWidth, canvas.clientHeight].map((n) => Math.round(n * ratio));
  if (canvas.width !== size[0]) canvas.width = size[0];
  if (canvas.height !== size[1]) canvas.height = size[1];
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
  return context;
}

function strokeWith(context, color, width, dash = []) {
  context.strokeStyle = color;
  context.lineWidth = width;
  context.setLineDash(dash.map((length) => length * width));
}

function circle(context, [x, y], radius) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
}

// Fills the current path so that what lies under it remains visible.
function tint(context, color, share) {
  context.globalAlpha = share;
  context.fillStyle = color;
  context.fill();
  context.globalAlpha = 1;
}

function drawLine(context, from, to) {
  context.beginPath();
  context.moveTo(...from);
  context.lineTo(...to);
  context.stroke();
}

function drawDot(context, place, radius, color) {
  context.fillStyle = color;
  circle(context, place, radius);
  context.fill();
}

// Half axes in millimetres, the heading of the first one in radians.
function drawEllipse(context, view, middle, axes, heading, color) {
  const [along, across] = axes.map((length) => length * view.scale);
  context.beginPath();
  context.ellipse(...view.at(middle.x, middle.y), along, across, -heading, 0, 2 * Math.PI);
  tint(context, color, 0.12);
  strokeWith(context, color, 1);
  context.stroke();
}

// A mark on the rim, so that rotation is visible.
function drawMark(context, view, pose, radius, inner) {
  const ray = [Math.cos(pose.angle) * radius, Math.sin(pose.angle) * radius];
  const end = (share) => view.at(pose.x + share * ray[0], pose.y + share * ray[1]);
  context.setLineDash([]);
  drawLine(context, end(inner), end(1));
}

function drawTrueDisk(context, view, pose, radius, ink) {
  circle(context, view.at(pose.x, pose.y), radius * view.scale);
  tint(context, ink, 0.13);
  strokeWith(context, ink, 1.25);
  context.stroke();
  drawMark(context, view, pose, radius, 0.72);
  drawDot(context, view.at(pose.x, pose.y), 2.5, ink);
}

function drawOutline(context, view, pose, radius, look) {
  strokeWith(context, look.color, 1.75, look.dash);
  circle(context, view.at(pose.x, pose.y), radius * view.scale);
  context.stroke();
  strokeWith(context, look.color, 1.75);
  drawMark(context, view, pose, radius, 0.86);
  drawDot(context, view.at(pose.x, pose.y), 2.5, look.color);
}

// The path so far, older parts fainter; `placeAt` returns the place at a step.
function drawTrail(context, view, placeAt, step, look, width) {
  strokeWith(context, look.color, width, look.dash);
  for (let piece = 0; piece < TRAIL_PIECES; piece += 1) {
    const poses = [piece, piece + 1].map((n) => placeAt((step * n) / TRAIL_PIECES));
    const [from, to] = poses.map(({ x, y }) => view.at(x, y));
    context.globalAlpha = lerp(0.2, 0.95, (piece + 1) / TRAIL_PIECES);
    drawLine(context, from, to);
    context.lineDashOffset += Math.hypot(to[0] - from[0], to[1] - from[1]) || 0;
  }
  context.lineDashOffset = 0;
  context.globalAlpha = 1;
}

function drawGrid(context, canvas, view, spacing, ink) {
  strokeWith(context, ink, 1);
  context.globalAlpha = 0.1;
  const count = Math.ceil(canvas.clientWidth / view.scale / spacing / 2) + 1;
  const start = view.middle.map((n) => Math.round(n / spacing));
  for (let line = -count; line <= count; line += 1) {
    const [x, y] = view.at((start[0] + line) * spacing, (start[1] + line) * spacing);
    drawLine(context, [x, 0], [x, canvas.clientHeight]);
    drawLine(context, [0, y], [canvas.clientWidth, y]);
  }
  context.globalAlpha = 1;
}

function drawScaleBar(context, canvas, view, ink) {
  const length = roundUp(48 / view.scale);
  const [right, bottom] = [canvas.clientWidth - 14, canvas.clientHeight - 14];
  strokeWith(context, ink, 1.5);
  drawLine(context, [right - length * view.scale, bottom], [right, bottom]);
  context.fillStyle = ink;
  context.font = "12px system-ui, sans-serif";
  context.textAlign = "right";
  context.fillText(`${length} mm`, right, bottom - 6);
}
